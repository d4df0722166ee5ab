/// Share of the last day for which the machine was outside its model's domain.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Hours of a day, each with the time that was looked at and the part of it that was outside. The
/// hour that is 24 h old is dropped as a new one begins.
class OutsideShare {
 public:
  /// @param now  must not run backwards; a gap of more than a minute counts as not looked at
  void step(nanoseconds now, bool outside) noexcept {
    const double gap_s = std::chrono::duration<double>(now - at_).count();
    const bool first = !started_;
    started_ = true;
    at_ = now;
    if (first || !(gap_s <= 60.0)) return;
    into_hour_s_ += gap_s;
    if (into_hour_s_ >= 3600.0) {
      into_hour_s_ = 0.0;
      hour_ = (hour_ + 1) % hours;
      looked_s_[hour_] = outside_s_[hour_] = 0.0;
    }
    looked_s_[hour_] += gap_s;
    if (outside) outside_s_[hour_] += gap_s;
  }

  /// 0 before anything was looked at.
  [[nodiscard]] double share() const noexcept {
    double looked_s = 0.0;
    double outside_s = 0.0;
    for (std::size_t i = 0; i < hours; ++i) {
      looked_s += looked_s_[i];
      outside_s += outside_s_[i];
    }
    return looked_s > 0 ? outside_s / looked_s : 0.0;
  }

  void visit_state(StateArchive& archive) {
    archive(started_, at_, into_hour_s_, hour_, looked_s_, outside_s_);
  }

 private:
  static constexpr std::size_t hours = 24;
  bool started_{false};
  nanoseconds at_{};
  double into_hour_s_{0.0};
  std::size_t hour_{0};
  std::array<double, hours> looked_s_{};
  std::array<double, hours> outside_s_{};
};

}  // namespace thermocomp
