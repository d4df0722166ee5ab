/// One axis from target to offset: limiter, agreement with the controller, proving move.
#pragma once

#include "estimator/applied_check.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/limiter.hpp"
#include "estimator/mismatch.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What one step of an axis needs to know.
struct AxisInput {
  nanoseconds now{};
  double dt_s{0.0};
  double target_um{0.0};  ///< NaN: stay
  bool may_change{true};  ///< false: surface-aware hold
  std::uint32_t link_epoch{0};
  bool online{false};  ///< the controller's values below are fresh
  double applied_um{not_a_number};
  nanoseconds taken_at{};  ///< when applied_um was read back
};

/// A read-back is evidence, not a command. The offset starts from it in three cases only: at the
/// first contact with a controller; on a new link, where it is nothing, or between that and what
/// was sent lately; and when an operator releases a mismatch. In all others the value sent stays
/// the axis' own.
///
/// A read-back that nothing sent lately explains pauses the axis; a second one before so many good
/// ones have followed latches the mismatch: the axis is not driven until release().
class AxisChannel {
 public:
  AxisChannel(const AxisConfig& config, const CompensationConfig& compensation, bool reads_back);

  void step(const AxisInput& input) noexcept;
  /// Moves by `move_um` and back; the compensation of this axis waits meanwhile. Ignored unless
  /// driven, or beyond prove_um_max.
  void prove(double move_um) noexcept;
  void end_prove() noexcept { prove_phase_ = ProvePhase::none; }
  /// An operator says that what caused a latched mismatch is mended. The next read-backs decide:
  /// explained by the very factor, sign or constant that was latched, or not two alike, it stays
  /// latched; else the axis starts from what is read back, once the slew rate would have had the
  /// time to go there from what was sent last.
  void release() noexcept;

  [[nodiscard]] double offset_um() const noexcept { return limiter_.offset_um(); }
  [[nodiscard]] double target_um() const noexcept { return target_um_; }
  /// As read back last; NaN where the controller does not tell.
  [[nodiscard]] double applied_um() const noexcept { return applied_um_; }
  [[nodiscard]] bool synced() const noexcept { return synced_; }
  /// Whether the offset may be sent: synced, started, and nothing read back is unexplained.
  [[nodiscard]] bool driven() const noexcept {
    return synced_ && !starting_ && !in_doubt_ && !latched_;
  }
  [[nodiscard]] bool mismatch() const noexcept { return mismatch_; }
  [[nodiscard]] bool latched() const noexcept { return latched_; }
  [[nodiscard]] bool releasing() const noexcept { return releasing_; }
  /// Of the newest latch.
  [[nodiscard]] const Mismatch& latched_mismatch() const noexcept { return latched_mismatch_; }
  [[nodiscard]] bool out_of_bound() const noexcept { return out_of_bound_; }
  [[nodiscard]] bool at_bound() const noexcept { return limiter_.at_bound(); }
  [[nodiscard]] bool proving() const noexcept { return prove_phase_ != ProvePhase::none; }

  /// Before the first step: what was sent last before the restart.
  void restore(double offset_um) noexcept;
  /// After a reload: goes on from the other's offset and agreement.
  void adopt(const AxisChannel& previous) noexcept;

  void visit_state(StateArchive& archive) {
    archive(limiter_, check_, target_um_, applied_um_, epoch_, trusted_um_, synced_, starting_,
            driven_once_, out_of_bound_, mismatch_, agreed_since_, in_doubt_, suspicion_, latched_,
            releasing_, released_um_, latched_mismatch_, pairs_, stands_for_, unwritten_for_,
            seen_at_, read_back_at_, driven_at_, prove_phase_, prove_from_um_, prove_move_um_,
            prove_until_);
  }

 private:
  enum class ProvePhase : std::uint8_t { none, out, wait, back };

  void take_epoch(std::uint32_t epoch) noexcept;
  void note_read_back(const AxisInput& input) noexcept;
  void synchronise(const AxisInput& input) noexcept;
  void compare(const AxisInput& input) noexcept;
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
  bool reads_back_;
  nanoseconds mismatch_after_;
  double prove_um_max_;
  nanoseconds prove_hold_;

  double target_um_{0.0};
  double applied_um_{not_a_number};
  std::uint32_t epoch_{0};
  /// Largest |offset| that can come from us: the bound, or what an earlier bound allowed.
  double trusted_um_;
  bool synced_{false};
  bool starting_{false};     ///< a new link's first believable read-back is waited for
  bool driven_once_{false};  ///< by this program: what is applied is no longer anybody's
  bool out_of_bound_{false};
  bool mismatch_{false};
  nanoseconds agreed_since_{};
  bool in_doubt_{false};  ///< the newest read-back is unexplained
  std::uint8_t suspicion_{0};
  /// After a pause of the link: read-backs until a command of the new epoch has surely been
  /// written.
  std::uint8_t stands_for_{0};
  std::uint8_t unwritten_for_{0};  ///< read-backs until what is read back is surely ours
  nanoseconds seen_at_{};          ///< of the newest read-back, also of one without offsets
  bool latched_{false};
  bool releasing_{false};
  double released_um_{not_a_number};  ///< read back since release(), to be confirmed
  Mismatch latched_mismatch_;
  SentAndRead pairs_;
  nanoseconds read_back_at_{};
  nanoseconds driven_at_{};
  ProvePhase prove_phase_{ProvePhase::none};
  double prove_from_um_{0.0};
  double prove_move_um_{0.0};
  nanoseconds prove_until_{};
};

}  // namespace thermocomp
