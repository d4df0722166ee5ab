// SPDX-License-Identifier: GPL-2.0-or-later
/// What the bridge's output pins show, decided from answers and from what HAL says. No I/O; time
/// is an argument.
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
  double fresh_s{1.0};           ///< so long after an answer offsets count as fresh
  double mismatch_mm{0.005};     ///< applied and asked for may differ by so much
  double mismatch_after_s{3.0};  ///< ... or longer by more; also how long a start may take
};

struct Outputs {
  /// None: the pin is not written, it keeps what it shows.
  std::vector<std::optional<double>> offset_mm;
  bool heartbeat{false};  ///< changes with every answer
  bool fresh{false};
  bool compensating{false};
  bool mismatch{false};
  bool warning{false};
  std::uint32_t faults{0};  ///< answers and values that were refused
};

/// Offsets are taken from answers only. Without answers they stay as they are. A new epoch starts
/// from what is applied, so that whatever happened meanwhile is no jump; while LinuxCNC takes no
/// offsets, none is asked for, so that it does not find an old one when it takes them again.
class BridgeState {
 public:
  BridgeState(std::size_t axes, const Limits& limits);

  /// An answer to the report made from `reported`.
  void take(const Answer& answer, const MachineView& reported, nanoseconds now);
  void fault() noexcept { ++outputs_.faults; }
  /// What to show now. Offsets are there once after they have changed.
  [[nodiscard]] Outputs show(const MachineView& view, nanoseconds now);

 private:
  struct Axis {
    std::optional<double> asked_mm;
    bool changed{false};
    std::optional<nanoseconds> apart_since;
  };

  void ask(Axis& axis, double offset_mm);
  void compare(Axis& axis, const AxisView& view, nanoseconds now);
  [[nodiscard]] bool lasts(const std::optional<nanoseconds>& since, nanoseconds now) const;

  Limits limits_;
  std::vector<Axis> axes_;
  Outputs outputs_;
  std::string mode_;
  std::optional<nanoseconds> answered_at_;
  std::optional<nanoseconds> idle_since_;  ///< taking, but not compensating
};

}  // namespace thermocomp_linuxcnc
