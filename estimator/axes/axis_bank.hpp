/// From targets to the command: all axes, and each with its limiter, its agreement with the
/// controller and its proving move.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/axes/mismatch.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// The applied offset must be between the smallest and the largest offset sent within the last
/// window, within a tolerance.
class AppliedCheck {
 public:
  AppliedCheck(double tolerance_um, nanoseconds window);

  /// Forgets all offsets sent; the axis is at `offset_um`.
  void restart(nanoseconds now, double offset_um) noexcept;
  void sent(nanoseconds now, double offset_um) noexcept;
  [[nodiscard]] bool agrees(double applied_um) const noexcept;
  /// True if the offset is more than 1.5 tolerances from all of them: with the default tolerance, a
  /// controller's rounding to 0.0001 inch cannot make both the same.
  [[nodiscard]] bool is_far(double offset_um) const noexcept;
  /// True if a controller that was away may apply this value without a command: an offset sent to
  /// it, 0, or a value between them on its way back.
  [[nodiscard]] bool agrees_after_absence(double applied_um) const noexcept;
  /// After a reload: offsets sent by `previous` count as sent.
  void adopt(const AppliedCheck& previous) noexcept { state_ = previous.state_; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  [[nodiscard]] bool is_between(double applied_um, double low_um, double high_um) const noexcept;
  [[nodiscard]] double lowest_um() const noexcept;
  [[nodiscard]] double highest_um() const noexcept;

  // Offsets expire in slots of a quarter window: cheap, and the window is exact to 25 %.
  static constexpr std::size_t slots = 5;
  struct State {
    std::array<double, slots> min_um{};
    std::array<double, slots> max_um{};
    std::size_t newest{0};
    nanoseconds slot_until{};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d] = *this;
      archive(a, b, c, d);
    }
  };
  const double tolerance_um_;
  const nanoseconds slot_length_;
  State state_;
};

/// offset += clamp(clamp(target, +-bound) - offset, +-rate dt). An offset outside the bound (a
/// smaller bound after a reload) returns at the slew limit.
class Limiter {
 public:
  explicit Limiter(const LimiterConfig& config);  ///< @throws InvalidValue

  /// @param target_um  NaN or infinite: stay
  /// @param dt_s       time since the last step; used up to LimiterConfig::step_s_max
  void step(double target_um, double dt_s) noexcept;
  /// Starts from the applied offset: the only permitted jump, since the axis is already there.
  void start_from(double offset_um) noexcept { offset_um_ = offset_um; }

  [[nodiscard]] double offset_um() const noexcept { return offset_um_; }
  [[nodiscard]] double bound_um() const noexcept { return config_.offset_um_max; }
  [[nodiscard]] double rate_um_per_s() const noexcept { return config_.rate_um_per_s_max; }
  /// True if the last target was outside the bound.
  [[nodiscard]] bool at_bound() const noexcept { return at_bound_; }
  void visit_state(StateArchive& archive) { archive(offset_um_, at_bound_); }

 private:
  const LimiterConfig config_;
  double offset_um_{0.0};
  bool at_bound_{false};
};

struct AxisInput {
  nanoseconds now{};
  double dt_s{0.0};
  double target_um{0.0};  ///< NaN: stay
  bool may_change{true};  ///< false: hold_while_cutting holds the offset
  std::uint32_t link_epoch{0};
  bool online{false};   ///< the controller's values below are fresh
  bool written{false};  ///< ControllerState::written
  double applied_um{not_a_number};
  nanoseconds taken_at{};
};

/// Offsets known from before the first step; NaN: unknown.
struct SentBefore {
  double saved_um{not_a_number};     ///< from the state file
  bool is_corridor{false};           ///< the sent offset had to stay near it
  double recorded_um{not_a_number};  ///< from the last-sent record
};

/// The offset starts from a read-back in three cases only: at the first contact with a controller;
/// on a new link whose read-back is zero, or between zero and the offsets sent lately; and when an
/// operator releases a mismatch. Otherwise it continues from the value sent.
///
/// A read-back is unexplained if it is far from all offsets sent lately, or stands still while the
/// offset sent moves. It pauses the axis; a second one within the next sixteen good ones latches
/// the mismatch: the axis is not driven until release(). Reports without a number for longer than
/// mismatch_after_s also pause it.
///
/// Without read-back the offset continues, on each new link, from the one sent last. Its sources,
/// in this order: the registers read when the link began (in place of the read-back), the offset
/// sent until then, the last-sent record, the state file. The start is unknown if the registers
/// contradict the other sources, or if no registers can be read and the link was absent (also at
/// the program's start) for longer than a controller needs to restart. Then the axis is not driven
/// until release(), which starts from 0. While no registers can be read, the offset stays within
/// restart_leap_um_max of every offset that may be on disk, and waits for the disk.
class AxisChannel {
 public:
  AxisChannel(const AxisConfig& config, const CompensationConfig& compensation, bool reads_back);

  /// Compares the controller's report with the offsets sent.
  void observe(const AxisInput& input) noexcept;
  /// Step without sending: the offset stays, and the window of sent offsets narrows to it.
  void hold(nanoseconds now) noexcept;
  /// Steps towards the target. @pre driven(), and the offset is sent
  void move(const AxisInput& input) noexcept;
  /// Moves by `move_um` and back; the compensation of this axis pauses meanwhile. Ignored if not
  /// driven, or beyond prove_um_max.
  void prove(double move_um) noexcept;
  void end_prove() noexcept { state_.prove.phase = ProvePhase::none; }
  /// Releases a latched mismatch whose cause an operator has removed. It stays latched if the next
  /// read-backs still fit the latched factor, sign or constant, or if no two of them agree; else
  /// the axis starts from the read-back, once its distance from the offset sent last is within
  /// reach at the slew limit. With an unknown start: begin_at_zero().
  void release() noexcept;
  /// An operator has set the offset to 0 at the controller.
  void begin_at_zero() noexcept;
  /// A state with this offset is on disk. Ignored outside the corridor (from before a release).
  void saved(double offset_um) noexcept;

  [[nodiscard]] double offset_um() const noexcept { return limiter_.offset_um(); }
  [[nodiscard]] double target_um() const noexcept { return state_.target_um; }
  /// Last read-back; NaN without read-back.
  [[nodiscard]] double applied_um() const noexcept { return state_.applied_um; }
  [[nodiscard]] bool synced() const noexcept { return state_.synced; }
  /// True if the offset may be sent: synchronised, started, and the read-back is explained.
  [[nodiscard]] bool driven() const noexcept {
    return state_.synced && !state_.starting && !state_.in_doubt && !state_.latched &&
           !start_.unknown && !(in_corridor() && std::isnan(start_.saved_um));
  }
  /// True if the offset to continue from is unknown on this link.
  [[nodiscard]] bool start_unknown() const noexcept { return state_.synced && start_.unknown; }
  [[nodiscard]] StartEvidence start() const noexcept {
    return start_.unknown ? StartEvidence::unknown : start_.by;
  }
  /// True if the last sent offset is unknown, with or without a link.
  [[nodiscard]] bool last_offset_unknown() const noexcept {
    return !reads_back_ && start_.by == StartEvidence::unknown;
  }
  /// Largest distance of the offset from the one on disk; NaN: not limited.
  [[nodiscard]] double corridor_um() const noexcept {
    return in_corridor() ? corridor_um_ : not_a_number;
  }
  /// True if the offset moves on only after a newer state is on disk.
  [[nodiscard]] bool waits_for_disk() const noexcept {
    return in_corridor() && (start_.held || !std::isfinite(start_.saved_um));
  }
  [[nodiscard]] bool mismatch() const noexcept { return state_.mismatch; }
  [[nodiscard]] bool latched() const noexcept { return state_.latched; }
  [[nodiscard]] bool releasing() const noexcept { return state_.releasing; }
  /// Offset sent and read-back at the newest latch.
  [[nodiscard]] const Mismatch& latched_mismatch() const noexcept {
    return state_.latched_mismatch;
  }
  [[nodiscard]] bool out_of_bound() const noexcept { return state_.out_of_bound; }
  [[nodiscard]] bool at_bound() const noexcept { return limiter_.at_bound(); }
  [[nodiscard]] bool proving() const noexcept { return state_.prove.phase != ProvePhase::none; }

  /// Before the first step. Offsets beyond the bound are ignored.
  void restore(const SentBefore& before) noexcept;
  /// After a reload: continues from the offset and agreement of `previous`.
  void adopt(const AxisChannel& previous) noexcept;

  void visit_state(StateArchive& archive) { archive(limiter_, check_, state_, start_); }

 private:
  enum class ProvePhase : std::uint8_t { none, out, wait, back };
  struct Prove {
    ProvePhase phase{ProvePhase::none};
    double from_um{0.0};
    double move_um{0.0};
    nanoseconds until{};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d] = *this;
      archive(a, b, c, d);
    }
  };
  struct State {
    double target_um{0.0};
    double applied_um{not_a_number};
    std::uint32_t epoch{0};
    /// Largest |offset| that can be ours: the bound, or that of an earlier configuration.
    double trusted_um{0.0};
    bool synced{false};
    bool starting{false};     ///< waits for the first plausible read-back of a new link
    bool driven_once{false};  ///< by this program, so the applied offset is ours
    bool out_of_bound{false};
    bool mismatch{false};
    nanoseconds agreed_since{};
    bool in_doubt{false};  ///< the newest read-back is unexplained
    std::uint8_t suspicion{0};
    bool latched{false};
    bool releasing{false};
    double released_um{not_a_number};  ///< read-back since release(), to be confirmed
    Mismatch latched_mismatch;
    SentAndRead pairs;
    /// After a pause of the link: read-backs until a command of the new epoch is surely written.
    std::uint8_t read_backs_awaited{0};
    std::uint8_t unwritten_for{0};  ///< read-backs until they surely show our offset
    nanoseconds seen_at{};          ///< time of the newest report, with or without offsets
    nanoseconds read_back_at{};
    nanoseconds driven_at{};
    Prove prove;
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w);
    }
  };

  struct Start {
    StartEvidence by{StartEvidence::unknown};  ///< source of the offset sent last
    bool unknown{false};                       ///< no source on this link
    bool no_registers{false};       ///< none on this link, so that only the disk keeps the offset
    double saved_um{not_a_number};  ///< in the newest state on disk
    bool held{false};               ///< limited by the corridor in the last step
    /// Range of the offset since the last saved(), and between the two before it, when a state
    /// still being written was taken.
    std::array<double, 2> low_um{};
    std::array<double, 2> high_um{};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g] = *this;
      archive(a, b, c, d, e, f, g);
    }
  };

  [[nodiscard]] bool in_corridor() const noexcept { return start_.no_registers && !start_.unknown; }
  void take_epoch(std::uint32_t epoch) noexcept;
  void note_read_back(const AxisInput& input) noexcept;
  void synchronise(const AxisInput& input, nanoseconds away) noexcept;
  void compare(const AxisInput& input) noexcept;
  void miss_read_back(const AxisInput& input) noexcept;
  void start_without_read_back(const AxisInput& input, nanoseconds away) noexcept;
  [[nodiscard]] bool can_be_ours(double register_um) const noexcept;
  void follow(const AxisInput& input) noexcept;
  [[nodiscard]] double within_corridor(double target_um) noexcept;
  void widen_corridor() noexcept;
  void begin_corridor(StartEvidence by) noexcept;
  void start_on_link(const AxisInput& input, bool fresh) noexcept;
  [[nodiscard]] bool stands_still(double applied_um) const noexcept;
  void note_explained(const AxisInput& input, bool fresh) noexcept;
  void note_unexplained(const AxisInput& input, bool fresh) noexcept;
  void check_release(const AxisInput& input) noexcept;
  void end_latch() noexcept;
  [[nodiscard]] bool is_applied(const AxisInput& input) const noexcept;
  [[nodiscard]] bool is_out_of_bound(double applied_um) const noexcept;
  void start_from(nanoseconds now, double offset_um) noexcept;
  [[nodiscard]] double prove_target_um(nanoseconds now) noexcept;

  Limiter limiter_;
  AppliedCheck check_;
  const bool reads_back_;
  const nanoseconds mismatch_after_;
  const double prove_um_max_;
  const nanoseconds prove_hold_;
  const double corridor_um_;

  State state_;
  Start start_;
};

/// Offsets that the axes approach.
struct Targets {
  std::span<const double> axis_um;  ///< one per axis; NaN: stay
  bool may_change{true};            ///< false: hold_while_cutting holds the offset
  bool waits_for_cut{false};        ///< the ramp to zero waits for the end of a cut
  bool hold_where_unknown{false};   ///< an axis without a target keeps its offset
};

/// The nodes of a travel are one axis, driven only while all of them may be, so that the controller
/// never follows a part of a set. A step therefore compares all nodes with the controller's report
/// before it moves any.
class AxisBank {
 public:
  explicit AxisBank(const EstimatorConfig& config);

  /// @param online   true if the controller's report is fresh
  /// @param command  overwritten: offsets of all axes, with the number of the read-back used
  void step(const StepTime& time, const Targets& targets, bool online,
            const ControllerState& controller, OffsetCommand& command) noexcept;

  [[nodiscard]] std::span<const AxisChannel> all() const noexcept { return axes_; }
  [[nodiscard]] std::size_t size() const noexcept { return axes_.size(); }
  [[nodiscard]] const AxisChannel& operator[](std::size_t axis) const noexcept {
    return axes_[axis];
  }
  /// True if all axes are synchronised and the last sent offset of at least one is known.
  [[nodiscard]] bool synced() const noexcept;
  /// One bit per axis: 1 if the last sent offset is unknown.
  [[nodiscard]] std::uint32_t last_offset_unknown() const noexcept;
  /// True if the offset may be sent: all nodes of the axis' travel are driven.
  [[nodiscard]] bool driven(std::size_t axis) const noexcept { return driven(span_of_[axis]); }
  [[nodiscard]] const AxisSpan& span(std::size_t axis) const noexcept { return span_of_[axis]; }

  /// Offset in effect as a displacement [um]: read back, or as sent without read-back.
  [[nodiscard]] double compensated_um(std::size_t axis) const noexcept;

  /// Moves the tool by `move_um`, hence the offset by `sign` times that: all nodes of a travel, or
  /// none.
  void prove(std::size_t axis, double move_um) noexcept;
  void release(std::size_t axis) noexcept;
  void end_proves() noexcept;

  void saved(std::size_t axis, double offset_um) noexcept { axes_[axis].saved(offset_um); }

  /// Before the first step: offsets known from before the restart.
  void restore(std::size_t axis, const SentBefore& before) noexcept { axes_[axis].restore(before); }
  /// @param axes  from plan_names()
  void adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept;
  void visit_state(StateArchive& archive);

 private:
  [[nodiscard]] bool driven(const AxisSpan& span) const noexcept;

  std::vector<AxisChannel> axes_;
  std::vector<AxisSpan> spans_;
  std::vector<AxisSpan> span_of_;  ///< one per axis, the same for all nodes of a travel
  std::vector<double> signs_;
};

}  // namespace thermocomp
