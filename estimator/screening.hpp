/// Which readings are refused before they can move an axis.
#pragma once

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Judges one sensor's readings, each once, when it is new. A refused reading is as good as none:
/// the last good one serves until it is stale.
class Screening {
 public:
  explicit Screening(const ScreeningConfig& config);

  /// Looks at the newest reading.
  /// @return whether it is a new and good one; then good_degC() and good_at() are its
  bool look(nanoseconds now, const Reading& reading) noexcept {
    if (reading.taken_at == seen_at_ && reading.fault == seen_fault_) return false;
    return take(now, reading);
  }

  /// Whether the last good reading may still be used at `now`.
  [[nodiscard]] bool usable(nanoseconds now) const noexcept {
    return has_good_ && now - good_at_ <= stale_after_;
  }
  /// Why the newest reading is not good: none while it is good and fresh.
  [[nodiscard]] Fault fault(nanoseconds now) const noexcept {
    if (verdict_ != Fault::none) return verdict_;
    return now - good_at_ > stale_after_ ? Fault::stale : Fault::none;
  }
  [[nodiscard]] double good_degC() const noexcept { return good_degC_; }
  [[nodiscard]] nanoseconds good_at() const noexcept { return good_at_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }

  /// After a reload: the past of the other, the rules of this one.
  void adopt(const Screening& previous) noexcept;

  void visit_state(StateArchive& archive) {
    archive(seen_at_, seen_fault_, verdict_, has_good_, confirmed_, good_degC_, good_at_,
            same_since_, rejected_);
  }

 private:
  [[nodiscard]] bool take(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] Fault judge(nanoseconds now, const Reading& reading) noexcept;

  double min_degC_;
  double max_degC_;
  double rate_K_per_ns_;
  double allowance_K_;
  nanoseconds stale_after_;
  nanoseconds stuck_after_;  ///< 0: never

  nanoseconds seen_at_{};
  Fault seen_fault_{Fault::never_read};
  Fault verdict_{Fault::never_read};
  bool has_good_{false};
  bool confirmed_{false};  ///< more than one reading has been good since the start
  double good_degC_{0.0};
  nanoseconds good_at_{};
  nanoseconds same_since_{};  ///< since when good_degC_ has not changed by one bit
  std::uint64_t rejected_{0};
};

}  // namespace thermocomp
