// SPDX-License-Identifier: GPL-2.0-or-later
/// Lines of an exchange with the daemon: JSON-RPC `controller_state` with the input pins, and
/// answer.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace thermocomp_linuxcnc {

/// Values of LinuxCNC's pin motion.motion-type.
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
  double wanted_mm{NAN};    ///< LinuxCNC's setpoint of the offset; differs during a move
  double position_mm{NAN};  ///< commanded position of the axis
};

struct MachineView {
  bool taking{false};  ///< offsets are added to the positions: machine on and homed, as defined in
                       ///< the HAL file
  bool enabled{false};
  bool homed{false};
  bool program_running{false};
  int motion_type{0};
  double spindle_rpm{NAN};
  bool flood{false};
  bool mist{false};
  std::vector<AxisView> axes;
};

/// A program runs without a rapid, tool change or indexing, or a feed without a program. A dwell or
/// feed hold within a program is a cut, since the tool may be in contact.
[[nodiscard]] inline bool in_cut(const MachineView& view) noexcept {
  const auto type = static_cast<MotionType>(view.motion_type);
  if (view.program_running)
    return type != MotionType::rapid && type != MotionType::tool_change &&
           type != MotionType::rotary;
  return type == MotionType::feed || type == MotionType::arc || type == MotionType::probe;
}

class BadAnswer : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Answer {
  bool anew{false};                              ///< offsets continue from the reported ones
  std::string mode;                              ///< daemon's mode: "compensating", "holding", ...
  std::vector<std::optional<double>> offset_mm;  ///< by axis; none: unchanged
  bool all_driven{true};                         ///< every axis of the daemon has an offset
};

/// @param axes  letters, in the order of view.axes
/// @return the line with its line feed. Values that are not finite become null
[[nodiscard]] std::string request_line(std::uint64_t session, std::uint64_t id,
                                       std::string_view axes, const MachineView& view);

/// @param offset_mm_max  larger offsets are refused
/// @throws BadAnswer: not JSON, of another request, an error, a missing axis, an invalid value
[[nodiscard]] Answer read_answer(std::string_view line, std::uint64_t id, std::string_view axes,
                                 double offset_mm_max);

}  // namespace thermocomp_linuxcnc
