/// When the correction of a machining cycle is due.
#pragma once

#include <cmath>
#include <cstdint>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Counts cycle ends from commands and from a signal of the controller, and says when they are due.
class CycleEnds {
 public:
  /// @param every      a correction at every n-th cycle end
  /// @param is_switch  the signal is 0 or 1, and ends a cycle by rising; else any change does
  CycleEnds(std::uint64_t every, bool is_switch) : every_(every), is_switch_(is_switch) {}

  struct State {
    std::uint64_t count{0};
    double last{not_a_number};  ///< of the signal
    bool due{false};
  };

  void command() noexcept { ended(); }
  /// @param value  NaN: not known, which ends nothing
  void signal(double value) noexcept {
    if (!std::isfinite(value)) return;
    if (std::isfinite(state_.last) &&
        (is_switch_ ? state_.last < 0.5 && value >= 0.5 : value != state_.last))
      ended();
    state_.last = value;
  }
  /// Whether the correction is due; once only. @param can  predictions are there to be taken
  [[nodiscard]] bool take(bool can) noexcept {
    const bool now = state_.due && can;
    if (now) state_.due = false;
    return now;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return state_.count; }
  /// @param same_signal  of the other's configuration and of ours: an edge during the reload
  ///                     counts; what another signal showed last says nothing
  void adopt(const CycleEnds& previous, bool same_signal) noexcept {
    const double last = same_signal ? previous.state_.last : state_.last;
    state_ = previous.state_;
    state_.last = last;
  }
  void visit_state(StateArchive& archive) {
    auto& [count, last, due] = state_;
    archive(count, last, due);
  }

 private:
  void ended() noexcept {
    if (++state_.count % every_ == 0) state_.due = true;
  }

  const std::uint64_t every_;
  const bool is_switch_;
  State state_;
};

}  // namespace thermocomp
