/// One axis from target to offset: limiter, agreement with the controller, proving move.
#pragma once

#include "estimator/applied_check.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/limiter.hpp"
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

class AxisChannel {
 public:
  AxisChannel(const AxisConfig& config, const CompensationConfig& compensation, bool reads_back);

  void step(const AxisInput& input) noexcept;
  /// Moves by `move_um` and back; the compensation of this axis waits meanwhile. Ignored unless
  /// synced, or beyond prove_um_max.
  void prove(double move_um) noexcept;
  void end_prove() noexcept { prove_phase_ = ProvePhase::none; }

  [[nodiscard]] double offset_um() const noexcept { return limiter_.offset_um(); }
  [[nodiscard]] double target_um() const noexcept { return target_um_; }
  /// As read back last; NaN where the controller does not tell.
  [[nodiscard]] double applied_um() const noexcept { return applied_um_; }
  [[nodiscard]] bool synced() const noexcept { return synced_; }
  /// Whether the offset may be sent: synced, the controller's own value is believable, and nothing
  /// that was sent before a disagreement can still be under way.
  [[nodiscard]] bool driven() const noexcept {
    return synced_ && !out_of_bound_ && read_backs_awaited_ == 0;
  }
  [[nodiscard]] bool mismatch() const noexcept { return mismatch_; }
  [[nodiscard]] bool out_of_bound() const noexcept { return out_of_bound_; }
  [[nodiscard]] bool at_bound() const noexcept { return limiter_.at_bound(); }
  [[nodiscard]] bool proving() const noexcept { return prove_phase_ != ProvePhase::none; }

  /// Before the first step: what was sent last before the restart.
  void restore(double offset_um) noexcept;
  /// After a reload: goes on from the other's offset and agreement.
  void adopt(const AxisChannel& previous) noexcept;

  void visit_state(StateArchive& archive) {
    archive(limiter_, check_, target_um_, applied_um_, epoch_, trusted_um_, synced_, out_of_bound_,
            mismatch_, agreed_since_, read_backs_awaited_, read_back_at_, prove_phase_,
            prove_from_um_, prove_move_um_, prove_until_);
  }

 private:
  enum class ProvePhase : std::uint8_t { none, out, wait, back };

  void synchronise(const AxisInput& input) noexcept;
  void compare(const AxisInput& input) noexcept;
  void await_read_back(const AxisInput& input) noexcept;
  [[nodiscard]] bool is_out_of_bound(double applied_um) const noexcept;
  void start_from_applied(const AxisInput& input) noexcept;
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
  bool out_of_bound_{false};
  bool mismatch_{false};
  nanoseconds agreed_since_{};
  std::uint8_t read_backs_awaited_{0};  ///< before the axis starts from what is applied
  nanoseconds read_back_at_{};          ///< the last one that was waited for
  ProvePhase prove_phase_{ProvePhase::none};
  double prove_from_um_{0.0};
  double prove_move_um_{0.0};
  nanoseconds prove_until_{};
};

}  // namespace thermocomp
