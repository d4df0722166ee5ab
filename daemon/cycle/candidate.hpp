/// A second model, evaluated in the same cycle but never sent, and its score at each probing.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <map>
#include <span>
#include <string>

#include "drivers/bus.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// An anytime-valid test by betting (Waudby-Smith and Ramdas 2024). Let e be the errors of
/// both models at the probings of an axis, m their mean square so far. At most one bet is made in
/// two hours, because neighbouring errors are correlated:
///
///     b = 0.95 tanh(lambda sum (e_model^2 - e_candidate^2) / m),   summed since the last bet
///     W = mean over lambda of prod (1 + b),   V the same with 1 - b
///
/// For equally good models E[b] = 0, and W ever exceeds 40 with a probability of at most 1/40
/// (Ville's inequality). W and V are averaged over axes. With prior probabilities of 1/2 for equal,
/// 1/4 for better and 1/4 for worse:
///
///     P(better) = W / (W + 2 + V)
class ModelContest {
 public:
  static constexpr std::array<double, 2> lambdas{0.25, 0.5};
  static constexpr std::chrono::hours apart{2};

  struct AxisScore {
    double probings{0.0};
    double model_um2{0.0};  ///< sum of squared errors
    double candidate_um2{0.0};
    std::array<double, lambdas.size()> log_better{};  ///< ln of prod (1 + b)
    std::array<double, lambdas.size()> log_worse{};   ///< ln of prod (1 - b)
  };
  using Score = std::array<AxisScore, axes_max>;

  void take(std::size_t axis, nanoseconds now, double model_error_um,
            double candidate_error_um) noexcept {
    const double model_um2 = model_error_um * model_error_um;
    const double candidate_um2 = candidate_error_um * candidate_error_um;
    if (!std::isfinite(model_um2) || !std::isfinite(candidate_um2)) return;
    AxisScore& score = score_[axis];
    score.probings += 1.0;
    score.model_um2 += model_um2;
    score.candidate_um2 += candidate_um2;
    Pending& pending = pending_[axis];
    pending.less_um2 += model_um2 - candidate_um2;
    if (now - pending.bet_at < apart) return;
    const double mean_um2 = (score.model_um2 + score.candidate_um2) / (2.0 * score.probings);
    const double less = mean_um2 > 0 ? pending.less_um2 / mean_um2 : 0.0;
    pending = {0.0, now};
    for (std::size_t i = 0; i < lambdas.size(); ++i) {
      const double bet = 0.95 * std::tanh(lambdas[i] * less);
      score.log_better[i] += std::log1p(bet);
      score.log_worse[i] += std::log1p(-bet);
    }
  }
  [[nodiscard]] const Score& score() const noexcept { return score_; }
  void restore(const Score& score) noexcept { score_ = score; }

  struct Chances {
    double better{0.0};
    double worse{0.0};
  };
  [[nodiscard]] static Chances chances(const Score& score) noexcept {
    const double better = wealth(score, &AxisScore::log_better);
    const double worse = wealth(score, &AxisScore::log_worse);
    return {better / (better + 2.0 + worse), worse / (better + 2.0 + worse)};
  }

 private:
  struct Pending {
    double less_um2{0.0};  ///< sum of (model error^2 - candidate error^2) since the last bet
    nanoseconds bet_at{-apart};
  };
  [[nodiscard]] static double wealth(const Score& score,
                                     std::array<double, lambdas.size()> AxisScore::*logs) noexcept {
    double sum = 0.0;
    double count = 0.0;
    for (const AxisScore& axis : score) {
      if (!(axis.probings > 0)) continue;
      for (const double log : axis.*logs) sum += std::exp(std::min(log, 500.0));
      count += static_cast<double>(lambdas.size());
    }
    return count > 0 ? sum / count : 1.0;
  }

  Score score_{};
  std::array<Pending, axes_max> pending_{};
};

/// Both models are scored without their running correction.
class Candidate {
 public:
  /// @param pair  ID of the pair of models: a score is valid for this pair only
  /// @throws InvalidValue
  Candidate(const EstimatorConfig& config, const ThermalModel& model, double pair)
      : pair_(pair), estimator_(config, model), score_(contest_.score()) {}

  // Called by the cycle: no allocation, no lock.

  /// Call before `running` gets the command.
  void command(const Command& command, const Estimator& running) noexcept;
  void step(nanoseconds now, std::span<const Reading> readings,
            const ControllerState& controller) noexcept {
    now_ = now;
    estimator_.step(now, readings, controller, unsent_);
  }
  /// Takes over from the previous estimator and, unless null, the previous candidate.
  void adopt(const Estimator& running, const Candidate* before) noexcept;

  [[nodiscard]] const Estimator& estimator() const noexcept { return estimator_; }

  // Called by main.

  void plan_adoption(const Estimator& running) { estimator_.plan_adoption(running); }
  /// Call before the first step.
  void restore(const PersistentState& state);
  [[nodiscard]] const ModelContest::Score& score() noexcept {
    score_.fresh();
    return score_.front();
  }
  /// Adds the score, as named numbers for restore(), to those of the correction.
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
