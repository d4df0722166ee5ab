// SPDX-License-Identifier: GPL-2.0-or-later
/// Writes the HAL file that adds the bridge's offsets to a machine with stock realtime components.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace thermocomp_linuxcnc {

enum class Way {
  joint,    ///< between motion and drive, by the component `offset`
  external  ///< by LinuxCNC's external offsets, through a gate
};

struct HalAxis {
  char letter{'x'};
  int joint{0};  ///< joint that moves the axis
};

struct HalFileOptions {
  Way way{Way::joint};
  std::string unit{"mm"};  ///< of the machine: mm or inch
  std::vector<HalAxis> axes;
  double offset_mm_max{0.2};
  double speed_mm_per_s{0.05};         ///< speed of an offset while all joints are homed
  double homing_speed_mm_per_s{1.0};   ///< joint: back to zero when a joint is un-homed
  double acceleration_mm_per_s2{0.5};  ///< while homed
  double homing_acceleration_mm_per_s2{20.0};
  std::string name{"thermocomp"};  ///< name of the bridge's HAL component
  std::string command{"thermocomp-linuxcnc"};
  std::string arguments;  ///< bridge's arguments besides --name and --axes
  std::string thread{"servo-thread"};
  int feedback_position{1};     ///< joint: position in the thread, after the drives' inputs
  int output_position{-1};      ///< joint: -1 is last; before the drives' outputs
  bool program_running{false};  ///< halui is loaded
  /// Pins of LinuxCNC already on a signal of the machine's HAL files: pin -> signal.
  std::map<std::string, std::string> signals;
};

class BadOption : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A length unit as LinuxCNC names it in [TRAJ]LINEAR_UNITS, in mm. @throws BadOption
[[nodiscard]] double unit_mm(const std::string& name);

/// @throws BadOption: no axis, a repeated axis or joint, an invalid letter or number, a signal for
/// a pin that the file does not connect
[[nodiscard]] std::string hal_file(const HalFileOptions& options);

/// File for `halcmd -f` after a bridge ended while LinuxCNC runs. After SIGTERM the bridge can be
/// loaded again under its own name. After a kill its component is blocked until LinuxCNC ends, so
/// another component with another name takes over its signals.
/// @param options  as for the file in use, but `name` is that of the bridge that ended
[[nodiscard]] std::string rejoin_file(const HalFileOptions& options, const std::string& name);

}  // namespace thermocomp_linuxcnc
