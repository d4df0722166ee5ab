/// Correction once a machining cycle: between two cycle ends the displacement that is compensated
/// stays what it was (JP7689460B2).
#pragma once

#include <cmath>
#include <cstdint>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// One axis. What is added at a cycle end is the difference of two predictions; since the first one
/// is added to the reference state, where it is 0, the sum is the newest prediction.
class CycleHold {
 public:
  /// @param ahead  share of the change since the last cycle end that is added beyond the newest
  ///               prediction: 1 is a whole cycle ahead by linear extrapolation
  explicit CycleHold(double ahead) : ahead_(ahead) {}

  void cycle_end(double predicted_um) noexcept {
    const double change_um = std::isfinite(last_um_) ? predicted_um - last_um_ : 0.0;
    held_um_ = predicted_um + ahead_ * change_um;
    last_um_ = predicted_um;
  }
  /// A new reference: predictions count from another state, so there is no change to go by.
  void restart() noexcept { last_um_ = not_a_number; }
  [[nodiscard]] double held_um() const noexcept { return held_um_; }  ///< NaN before the first
  void restore(double held_um) noexcept { held_um_ = held_um; }
  void adopt(const CycleHold& previous) noexcept {
    held_um_ = previous.held_um_;
    last_um_ = previous.last_um_;
  }
  void visit_state(StateArchive& archive) { archive(held_um_, last_um_); }

 private:
  double ahead_;
  double held_um_{not_a_number};
  double last_um_{not_a_number};
};

/// Counts cycle ends from commands and from a signal of the controller, and says when they are due.
class CycleEnds {
 public:
  /// @param every     a correction at each so-many-th cycle end
  /// @param is_switch  the signal is 0 or 1, and ends a cycle by rising; else any change does
  CycleEnds(std::uint64_t every, bool is_switch) : every_(every), is_switch_(is_switch) {}

  void command() noexcept { ended(); }
  /// @param value  NaN: not known, which ends nothing
  void signal(double value) noexcept {
    if (!std::isfinite(value)) return;
    if (std::isfinite(last_) && (is_switch_ ? last_ < 0.5 && value >= 0.5 : value != last_))
      ended();
    last_ = value;
  }
  /// Whether the correction is due; once only. @param can  predictions are there to be taken
  [[nodiscard]] bool take(bool can) noexcept {
    const bool now = due_ && can;
    if (now) due_ = false;
    return now;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// @param same_signal  of the other's configuration and of ours: an edge during the reload counts
  void adopt(const CycleEnds& previous, bool same_signal) noexcept {
    count_ = previous.count_;
    due_ = previous.due_;
    if (same_signal) last_ = previous.last_;
  }
  void visit_state(StateArchive& archive) { archive(count_, last_, due_); }

 private:
  void ended() noexcept {
    if (++count_ % every_ == 0) due_ = true;
  }

  std::uint64_t every_;
  bool is_switch_;
  std::uint64_t count_{0};
  double last_{not_a_number};
  bool due_{false};
};

}  // namespace thermocomp
