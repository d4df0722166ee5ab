/// Mode and reasons of a step, and the targets of the axes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

enum class Mode : std::uint8_t {
  starting,  ///< never compensated since the start; offsets stay
  disabled,  ///< by an operator or the controller's switch; offsets at zero or on the way
  compensating,
  holding,         ///< data lost: offsets stay
  ramping_to_zero  ///< daemon stopping, or data lost for hold_s and on_loss = ramp_to_zero
};
[[nodiscard]] std::string_view to_string(Mode mode) noexcept;

/// Reasons and warnings of a step; a set of bits.
enum class Reason : std::uint32_t {
  operator_disabled = 1u << 0,
  controller_disabled = 1u << 1,  ///< disable_signal is 1
  block_lost = 1u << 2,           ///< no good sensor in a block that the model needs
  signal_lost = 1u << 3,  ///< a position or operating signal that the model needs is missing
  no_reference = 1u << 4,
  controller_offline = 1u << 5,
  not_synced = 1u << 6,  ///< the applied offset is not known yet
  mismatch = 1u << 7,    ///< applied and sent differ
  cutting = 1u << 8,     ///< hold_while_cutting holds the offset
  at_bound = 1u << 9,
  applied_out_of_bound = 1u << 10,  ///< read-back beyond all our bounds: axis is not driven
  block_estimated = 1u << 11,       ///< a warning: compensating with an estimate of a lost block
  mismatch_latched = 1u << 12,      ///< unexplained read-backs: not driven until released
  no_target = 1u << 13,             ///< the model's displacement is not finite
  outside_domain = 1u << 14,
  sensor_suspected = 1u << 15,    ///< a warning: good values that the neighbours contradict
  not_written = 1u << 16,         ///< the controller answers, but confirms no write of offsets
  sensor_unconfirmed = 1u << 17,  ///< an unconfirmed reading contradicts the earlier ones
  start_unknown = 1u << 18        ///< the last sent offset is not known
};
inline constexpr std::size_t reasons_count = 19;
[[nodiscard]] std::string_view to_string(Reason reason) noexcept;

/// True if a set of reasons (Report::reasons) holds `reason`.
[[nodiscard]] constexpr bool has_reason(std::uint32_t reasons, Reason reason) noexcept {
  return (reasons & static_cast<std::uint32_t>(reason)) != 0;
}

struct ModeInput {
  StepTime time;
  bool displacement_known{false};
  bool controller_online{false};
  bool axes_synced{false};          ///< the applied offset of each axis is known
  bool controller_written{false};   ///< the newest writes of offsets are confirmed
  bool controller_disables{false};  ///< by its switch, as last reported
};

/// The mode is the first that holds:
///
///     disabled          by the operator or the controller
///     ramping_to_zero   the daemon is stopping, or nothing worked for longer than hold_s and
///                       on_loss is ramp_to_zero
///     compensating      displacement, controller and applied offsets are known, and the offsets
///                       are written ("works")
///     holding           it worked before
///     starting          it has never worked
class ModeDecision {
 public:
  struct State {
    bool ever_worked{false};
    nanoseconds lost_since{};  ///< the last step that worked, or the first one
    bool enabled{true};        ///< the operator's switch
    bool stopping{false};      ///< the daemon is stopping: offsets to zero
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

/// Compensating: the negative of the displacement, times the axis' sign. Disabled or ramping to
/// zero: zero. Otherwise: stay.
///
/// Loss of data never clears an offset during a cut, or where cutting is unknown: the offset is
/// held as in Mode::holding, so that one outside a smaller bound still returns into it.
class TargetRule {
 public:
  explicit TargetRule(const EstimatorConfig& config);

  /// @param axis_um  one per axis: the displacement to compensate
  [[nodiscard]] Targets step(Mode mode, std::span<const double> axis_um,
                             const Displacement& displacement, const Signals& signals) noexcept;

 private:
  const bool hold_while_cutting_;
  std::vector<double> signs_;
  std::vector<double> targets_um_;
};

}  // namespace thermocomp
