/// One axis from target to offset: limiter, agreement with the controller, proving move.
#pragma once

#include <array>
#include <cmath>

#include "estimator/axes/read_back.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// offset += clamp(clamp(target, +-bound) - offset, +-rate dt). An offset that starts outside the
/// bound (a smaller bound after a reload) comes in at the rate.
class Limiter {
 public:
  explicit Limiter(const LimiterConfig& config);  ///< @throws InvalidValue

  /// @param target_um  where to go; NaN or infinite: stay
  /// @param dt_s       time since the last step; used up to 1 s, so that a cycle that comes back
  ///                   after a long overrun makes no leap
  void step(double target_um, double dt_s) noexcept;
  /// Starts from what is applied; the only way the offset may jump, because the axis is there.
  void start_from(double offset_um) noexcept { offset_um_ = offset_um; }

  [[nodiscard]] double offset_um() const noexcept { return offset_um_; }
  [[nodiscard]] double bound_um() const noexcept { return bound_um_; }
  [[nodiscard]] double rate_um_per_s() const noexcept { return rate_um_per_s_; }
  /// Whether the last target lay outside the bound.
  [[nodiscard]] bool at_bound() const noexcept { return at_bound_; }
  void visit_state(StateArchive& archive) { archive(offset_um_, at_bound_); }

 private:
  double bound_um_;
  double rate_um_per_s_;
  double offset_um_{0.0};
  bool at_bound_{false};
};

/// What one step of an axis needs to know.
struct AxisInput {
  nanoseconds now{};
  double dt_s{0.0};
  double target_um{0.0};  ///< NaN: stay
  bool may_change{true};  ///< false: surface-aware hold
  std::uint32_t link_epoch{0};
  bool online{false};   ///< the controller's values below are fresh
  bool written{false};  ///< ControllerState::written
  double applied_um{not_a_number};
  nanoseconds taken_at{};  ///< when applied_um was read back
};

/// What is known of the offset that was sent before the first step; NaN: nothing.
struct SentBefore {
  double saved_um{not_a_number};     ///< by the state file
  bool is_corridor{false};           ///< the offset sent had to stay beside it
  double recorded_um{not_a_number};  ///< by the last-sent record
};

/// A read-back is evidence, not a command. The offset starts from it in three cases only: at the
/// first contact with a controller; on a new link, where it is nothing, or between that and what
/// was sent lately; and when an operator releases a mismatch. In all other cases the value sent
/// stays the axis' own.
///
/// A read-back that nothing sent lately explains pauses the axis; a second one, before sixteen good
/// ones have followed, latches the mismatch: the axis is not driven until release().
///
/// Without read-back the offset goes on, on each new link, from the one sent last. It is known, in
/// this order, by the registers as they stood when the link began (they come in place of the
/// read-back), by what was sent until then, by the record, by the state file. Registers that
/// contradict what else is known, and a link that was away for longer than a controller needs to
/// restart and has no registers to read, make it unknown: the axis is not driven until release(),
/// which starts from 0. While no registers can be read, the offset stays within restart_leap_um_max
/// of every one that may be on disk, so that it waits where the disk does not follow.
class AxisChannel {
 public:
  AxisChannel(const AxisConfig& config, const CompensationConfig& compensation, bool reads_back);

  /// What the controller tells: may it be driven?
  void observe(const AxisInput& input) noexcept;
  /// Nothing is sent in this step: what was sent last stays, and in time is all that was.
  void stand(nanoseconds now) noexcept;
  /// Towards the target. @pre driven(), and the offset is sent
  void move(const AxisInput& input) noexcept;
  /// Moves by `move_um` and back; the compensation of this axis waits meanwhile. Ignored unless
  /// driven, or beyond prove_um_max.
  void prove(double move_um) noexcept;
  void end_prove() noexcept { state_.prove.phase = ProvePhase::none; }
  /// An operator says that what caused a latched mismatch is mended. The next read-backs decide:
  /// explained by the same factor, sign or constant that was latched, or no two of them alike, it
  /// stays latched; else the axis starts from what is read back, once it could have got there at
  /// its slew rate from what was sent last. Of an unknown start: begin_at_zero().
  void release() noexcept;
  /// An operator has set the offset at the controller to 0.
  void begin_at_zero() noexcept;
  /// A state with this offset is on disk. One from before a release means nothing any more.
  void saved(double offset_um) noexcept;

  [[nodiscard]] double offset_um() const noexcept { return limiter_.offset_um(); }
  [[nodiscard]] double target_um() const noexcept { return state_.target_um; }
  /// As read back last; NaN where the controller does not tell.
  [[nodiscard]] double applied_um() const noexcept { return state_.applied_um; }
  [[nodiscard]] bool synced() const noexcept { return state_.synced; }
  /// Whether the offset may be sent: synced, started, and nothing read back is unexplained.
  [[nodiscard]] bool driven() const noexcept {
    return state_.synced && !state_.starting && !state_.in_doubt && !state_.latched &&
           !start_.unknown && !(in_corridor() && std::isnan(start_.saved_um));
  }
  /// What the offset goes on from is not known.
  [[nodiscard]] bool start_unknown() const noexcept { return state_.synced && start_.unknown; }
  [[nodiscard]] StartEvidence start() const noexcept {
    return start_.unknown ? StartEvidence::unknown : start_.by;
  }
  /// Nothing is known of what was sent last, whether or not a link is there.
  [[nodiscard]] bool forgotten() const noexcept {
    return !reads_back_ && start_.by == StartEvidence::unknown;
  }
  /// How far the offset goes from the one that is on disk; NaN: as far as it likes.
  [[nodiscard]] double corridor_um() const noexcept {
    return in_corridor() ? corridor_um_ : not_a_number;
  }
  /// It would go on if a newer state were on disk.
  [[nodiscard]] bool waits_for_disk() const noexcept {
    return in_corridor() && (start_.held || !std::isfinite(start_.saved_um));
  }
  [[nodiscard]] bool mismatch() const noexcept { return state_.mismatch; }
  [[nodiscard]] bool latched() const noexcept { return state_.latched; }
  [[nodiscard]] bool releasing() const noexcept { return state_.releasing; }
  /// What was sent and read when the newest latch came.
  [[nodiscard]] const Mismatch& latched_mismatch() const noexcept {
    return state_.latched_mismatch;
  }
  [[nodiscard]] bool out_of_bound() const noexcept { return state_.out_of_bound; }
  [[nodiscard]] bool at_bound() const noexcept { return limiter_.at_bound(); }
  [[nodiscard]] bool proving() const noexcept { return state_.prove.phase != ProvePhase::none; }

  /// Before the first step. What lies beyond the bound is not taken.
  void restore(const SentBefore& before) noexcept;
  /// After a reload: goes on from the other's offset and agreement.
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
    /// Largest |offset| that can come from us: the bound, or what an earlier bound allowed.
    double trusted_um{0.0};
    bool synced{false};
    bool starting{false};     ///< a new link's first believable read-back is waited for
    bool driven_once{false};  ///< by this program, so what is applied is ours
    bool out_of_bound{false};
    bool mismatch{false};
    nanoseconds agreed_since{};
    bool in_doubt{false};  ///< the newest read-back is unexplained
    std::uint8_t suspicion{0};
    bool latched{false};
    bool releasing{false};
    double released_um{not_a_number};  ///< read back since release(), to be confirmed
    Mismatch latched_mismatch;
    SentAndRead pairs;
    /// After a pause of the link: read-backs until a command of the new epoch has surely been
    /// written.
    std::uint8_t stands_for{0};
    std::uint8_t unwritten_for{0};  ///< read-backs until what is read back is surely ours
    nanoseconds seen_at{};          ///< of the newest read-back, also of one without offsets
    nanoseconds read_back_at{};
    nanoseconds driven_at{};
    Prove prove;
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w);
    }
  };

  struct Start {
    StartEvidence by{StartEvidence::unknown};  ///< what is known of the offset sent last
    bool unknown{false};                       ///< on this link
    bool no_registers{false};                  ///< on this link, so that only the disk remembers
    double saved_um{not_a_number};             ///< in the newest state that is on disk
    bool held{false};                          ///< by the corridor, in the last step
    /// Where the offset has been since the last saved(), and between the two before: a state that
    /// is on its way to the disk was taken then.
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
  void start_without_read_back(const AxisInput& input, nanoseconds away) noexcept;
  [[nodiscard]] bool can_be_ours(double register_um) const noexcept;
  [[nodiscard]] double within_corridor(double target_um) noexcept;
  void widen_corridor() noexcept;
  void begin_corridor(StartEvidence by) noexcept;
  void start_on_link(const AxisInput& input, bool fresh) noexcept;
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

}  // namespace thermocomp
