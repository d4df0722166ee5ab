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
    if (reading.taken_at == state_.seen_at && reading.fault == state_.seen_fault) return false;
    return take(now, reading);
  }

  /// Whether the last good reading may still be used at `now`.
  [[nodiscard]] bool usable(nanoseconds now) const noexcept {
    return state_.good.known && now - state_.good.at <= stale_after_;
  }
  /// Why the newest reading is not good: none while it is good and fresh.
  [[nodiscard]] Fault fault(nanoseconds now) const noexcept {
    if (state_.verdict != Fault::none) return state_.verdict;
    return now - state_.good.at > stale_after_ ? Fault::stale : Fault::none;
  }
  [[nodiscard]] double good_degC() const noexcept { return state_.good.temp_degC; }
  [[nodiscard]] nanoseconds good_at() const noexcept { return state_.good.at; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return state_.rejected; }

  /// After a reload: the past of the other, the rules of this one.
  void adopt(const Screening& previous) noexcept { state_ = previous.state_; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  struct Value {
    bool known{false};
    double temp_degC{0.0};
    nanoseconds at{};
    void visit_state(StateArchive& archive) { archive(known, temp_degC, at); }
  };
  struct State {
    nanoseconds seen_at{};
    Fault seen_fault{Fault::never_read};
    Fault verdict{Fault::never_read};
    Value good;                ///< the last good one
    Value before;              ///< the last good one before `good`, while that is not confirmed
    Value doubted;             ///< known: the next good one must agree with it
    bool confirmed{false};     ///< a recent one agreed with `good`
    nanoseconds same_since{};  ///< since when `good` has not changed by one bit
    std::uint64_t rejected{0};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i] = *this;
      archive(a, b, c, d, e, f, g, h, i);
    }
  };

  [[nodiscard]] bool take(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] Fault judge(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] bool follows(const Value& value, const Reading& reading) const noexcept;
  [[nodiscard]] bool is_recent(const Value& value, const Reading& reading) const noexcept;
  void doubt(const Reading& reading) noexcept;

  const double min_degC_;
  const double max_degC_;
  const double rate_K_per_ns_;
  const double allowance_K_;
  const nanoseconds stale_after_;
  const nanoseconds stuck_after_;  ///< 0: never

  State state_;
};

}  // namespace thermocomp
