// SPDX-License-Identifier: GPL-2.0-or-later
/// What the bridge knows of the machine: the input pins of its HAL component at one moment.
#pragma once

#include <cmath>
#include <vector>

namespace thermocomp_linuxcnc {

/// LinuxCNC's numbers of a kind of motion (pin motion.motion-type).
enum class MotionType {
  none = 0,
  rapid = 1,
  feed = 2,
  arc = 3,
  tool_change = 4,
  probe = 5,
  rotary = 6
};

struct AxisView {
  double applied_mm{NAN};   ///< offset in effect
  double wanted_mm{NAN};    ///< offset that LinuxCNC has been told; differs while it moves there
  double position_mm{NAN};  ///< of the axis, commanded
};

struct MachineView {
  bool taking{false};  ///< offsets are added to the positions: on, homed, as the HAL file has it
  bool enabled{false};
  bool homed{false};
  bool program_running{false};
  int motion_type{0};
  double spindle_rpm{NAN};
  bool flood{false};
  bool mist{false};
  std::vector<AxisView> axes;
};

/// Program running and not a rapid, a tool change or an indexing; or feeding without a program. A
/// dwell or a feed hold within a program is a cut: the tool may stand in the work.
[[nodiscard]] inline bool in_cut(const MachineView& view) noexcept {
  const auto type = static_cast<MotionType>(view.motion_type);
  if (view.program_running)
    return type != MotionType::rapid && type != MotionType::tool_change &&
           type != MotionType::rotary;
  return type == MotionType::feed || type == MotionType::arc || type == MotionType::probe;
}

}  // namespace thermocomp_linuxcnc
