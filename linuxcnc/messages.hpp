// SPDX-License-Identifier: GPL-2.0-or-later
/// The two lines of an exchange with the daemon: JSON-RPC `controller_state`, which reports the
/// input pins of the HAL component at one moment, and its answer.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
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
  double wanted_mm{NAN};    ///< setpoint of the offset in LinuxCNC; differs while it moves there
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

/// An answer that must not be acted on.
class BadAnswer : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Answer {
  bool anew{false};                              ///< offsets go on from what was reported
  std::string mode;                              ///< of the daemon: "compensating", "holding", ...
  std::vector<std::optional<double>> offset_mm;  ///< order of the axes; none: leave it as it is
};

/// @param axes  letters; view.axes is in their order
/// @return with its line's end. Values that are not finite become null
[[nodiscard]] std::string request_line(std::uint64_t session, std::uint64_t id,
                                       std::string_view axes, const MachineView& view);

/// @param offset_mm_max  a larger offset is no offset
/// @throws BadAnswer: not JSON, of another request, an error, an axis left out, a value that
///         cannot be
[[nodiscard]] Answer read_answer(std::string_view line, std::uint64_t id, std::string_view axes,
                                 double offset_mm_max);

}  // namespace thermocomp_linuxcnc
