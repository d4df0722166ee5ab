// SPDX-License-Identifier: GPL-2.0-or-later
/// State of the bridge's output pins from answers and input pins. No I/O; time is an argument.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "linuxcnc/messages.hpp"

namespace thermocomp_linuxcnc {

using std::chrono::nanoseconds;

struct Limits {
  double offset_mm_max{0.2};     ///< a larger offset is refused
  double fresh_s{1.0};           ///< maximum age of a fresh answer
  double mismatch_mm{0.005};     ///< tolerance between applied and requested offset
  double mismatch_after_s{3.0};  ///< duration of a mismatch before a warning; also of a start
};

struct Outputs {
  /// None: the pin is not written and keeps its value.
  std::vector<std::optional<double>> offset_mm;
  bool heartbeat{false};  ///< toggles with every answer
  bool fresh{false};
  bool compensating{false};
  bool mismatch{false};
  bool warning{false};
  std::uint32_t faults{0};  ///< refused answers and values
};

/// Offsets change only by answers. A new epoch starts from the applied offset, to avoid a jump.
/// While LinuxCNC takes no offsets, zero is requested, so that it later finds no old one.
class BridgeState {
 public:
  BridgeState(std::size_t axes, const Limits& limits);

  /// Takes the answer to the request made from `reported`.
  void take(const Answer& answer, const MachineView& reported, nanoseconds now);
  void fault() noexcept { ++outputs_.faults; }
  /// Returns the outputs at time `now`. Each change of an offset is returned once.
  [[nodiscard]] Outputs show(const MachineView& view, nanoseconds now);

 private:
  struct Axis {
    std::optional<double> asked_mm;
    bool changed{false};
    std::optional<nanoseconds> apart_since;
  };

  void ask(Axis& axis, double offset_mm);
  void compare(Axis& axis, const AxisView& view, nanoseconds now);
  [[nodiscard]] bool is_fresh(const std::optional<nanoseconds>& time, nanoseconds now) const;
  [[nodiscard]] bool lasts(const std::optional<nanoseconds>& since, nanoseconds now) const;

  Limits limits_;
  std::vector<Axis> axes_;
  Outputs outputs_;
  std::string mode_;
  std::optional<nanoseconds> answered_at_;
  std::optional<nanoseconds> driven_at_;   ///< newest answer that drives every axis
  std::optional<nanoseconds> idle_since_;  ///< taking, but not compensating
};

}  // namespace thermocomp_linuxcnc
