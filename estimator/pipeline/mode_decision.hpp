/// What the estimator does in this step.
#pragma once

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/mode.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct ModeInput {
  StepTime time;
  bool displacement_known{false};
  bool controller_online{false};
  bool axes_synced{false};          ///< what the controller applies is known of each axis
  bool controller_written{false};   ///< offsets that were sent lately are known to have been taken
  bool controller_disables{false};  ///< by its switch, as last told
};

/// The rule, the first that holds:
///
///     disabled          by the operator or the controller
///     ramping_to_zero   the daemon is about to end, or nothing worked for longer than hold_s and
///                       on_loss says so
///     compensating      displacement, controller and what it applies are known, and the offsets
///                       are written ("works")
///     holding           it worked before
///     starting          it never did
class ModeDecision {
 public:
  struct State {
    bool ever_worked{false};
    nanoseconds lost_since{};  ///< the last step that worked, or the first one
    bool enabled{true};        ///< the operator's switch
    bool stopping{false};      ///< the daemon is about to end: nowhere but to zero
    Mode mode{Mode::starting};
    nanoseconds mode_since{};
  };

  explicit ModeDecision(const CompensationConfig& config);

  Mode step(const ModeInput& input) noexcept;

  void enable(bool enabled) noexcept { state_.enabled = enabled; }
  void stop() noexcept { state_.stopping = true; }
  [[nodiscard]] const State& state() const noexcept { return state_; }

  void adopt(const ModeDecision& previous) noexcept { state_ = previous.state_; }
  void visit_state(StateArchive& archive) {
    auto& [ever_worked, lost_since, enabled, stopping, mode, mode_since] = state_;
    archive(ever_worked, lost_since, enabled, stopping, mode, mode_since);
  }

 private:
  [[nodiscard]] Mode decide(const ModeInput& input, bool works) const noexcept;

  const bool gives_up_;  ///< on_loss = "ramp_to_zero"
  const nanoseconds hold_;
  State state_;
};

}  // namespace thermocomp
