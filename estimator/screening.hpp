/// Which readings are refused before they can move an axis.
#pragma once

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Judges one sensor's readings, each once, when it is new. A refused reading is as good as none:
/// the last good one serves until it is stale.
///
/// The first value after the start or an outage has little to be compared with, so it may be the
/// false one when the next contradicts it. Then neither is believed, and it takes two in a row that
/// agree with each other (and with the last good one before the outage).
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
    return good_.known && now - good_.at <= stale_after_;
  }
  /// Why the newest reading is not good: none while it is good and fresh.
  [[nodiscard]] Fault fault(nanoseconds now) const noexcept {
    if (verdict_ != Fault::none) return verdict_;
    return now - good_.at > stale_after_ ? Fault::stale : Fault::none;
  }
  [[nodiscard]] double good_degC() const noexcept { return good_.temp_degC; }
  [[nodiscard]] nanoseconds good_at() const noexcept { return good_.at; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }

  /// After a reload: the past of the other, the rules of this one.
  void adopt(const Screening& previous) noexcept;

  void visit_state(StateArchive& archive) {
    archive(seen_at_, seen_fault_, verdict_, good_, before_, doubted_, confirmed_, same_since_,
            rejected_);
  }

 private:
  struct Value {
    bool known{false};
    double temp_degC{0.0};
    nanoseconds at{};
    void visit_state(StateArchive& archive) { archive(known, temp_degC, at); }
  };

  [[nodiscard]] bool take(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] Fault judge(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] bool follows(const Value& value, const Reading& reading) const noexcept;
  [[nodiscard]] bool is_recent(const Value& value, const Reading& reading) const noexcept;
  void doubt(const Reading& reading) noexcept;

  double min_degC_;
  double max_degC_;
  double rate_K_per_ns_;
  double allowance_K_;
  nanoseconds stale_after_;
  nanoseconds stuck_after_;  ///< 0: never

  nanoseconds seen_at_{};
  Fault seen_fault_{Fault::never_read};
  Fault verdict_{Fault::never_read};
  Value good_;                ///< the last good one
  Value before_;              ///< the last good one before good_, while good_ is not confirmed
  Value doubted_;             ///< known: the next good one must agree with it
  bool confirmed_{false};     ///< a recent one agreed with good_
  nanoseconds same_since_{};  ///< since when good_ has not changed by one bit
  std::uint64_t rejected_{0};
};

}  // namespace thermocomp
