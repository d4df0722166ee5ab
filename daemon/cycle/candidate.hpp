/// A model that runs beside the one in use: evaluated in the same cycle, never sent, scored at each
/// probing.
#pragma once

#include <map>
#include <span>
#include <string>

#include "drivers/wait_free_slot.hpp"
#include "estimator/learning/model_contest.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// Both models are judged by themselves, without a running correction.
class Candidate {
 public:
  /// @param pair  number of the two models: a score counts for this pair only
  /// @throws InvalidValue
  Candidate(const EstimatorConfig& config, const ThermalModel& model, double pair)
      : pair_(pair), estimator_(config, model), score_(contest_.score()) {}

  // The cycle's side: no allocation, no lock.

  /// Before `running` gets the command.
  void command(const Command& command, const Estimator& running) noexcept;
  void step(nanoseconds now, std::span<const Reading> readings,
            const ControllerState& controller) noexcept {
    now_ = now;
    estimator_.step(now, readings, controller, unsent_);
  }
  /// From the estimator that ran before, and from the candidate beside it where there was one.
  void adopt(const Estimator& running, const Candidate* before) noexcept;

  [[nodiscard]] const Estimator& estimator() const noexcept { return estimator_; }

  // Main's side.

  void plan_adoption(const Estimator& running) { estimator_.plan_adoption(running); }
  /// Before the first step.
  void restore(const PersistentState& state);
  [[nodiscard]] const ModelContest::Score& score() noexcept {
    score_.fresh();
    return score_.front();
  }
  /// The score, for restore(): numbers by name beside those of the correction.
  void add_to(std::map<std::string, double>& correction);

 private:
  void publish() noexcept;

  const double pair_;
  Estimator estimator_;
  OffsetCommand unsent_;
  nanoseconds now_{};
  ModelContest contest_;
  WaitFreeSlot<ModelContest::Score> score_;  ///< cycle -> main
};

}  // namespace thermocomp
