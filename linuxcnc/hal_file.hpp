// SPDX-License-Identifier: GPL-2.0-or-later
/// Writes the HAL file of stock realtime parts that adds the bridge's offsets to a machine.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace thermocomp_linuxcnc {

/// Where the offset enters.
enum class Way {
  joint,    ///< between motion and drive, by the component `offset`
  external  ///< LinuxCNC's external offsets, behind a gate
};

struct HalAxis {
  char letter{'x'};
  int joint{0};  ///< that moves it
};

struct HalFileOptions {
  Way way{Way::joint};
  std::vector<HalAxis> axes;
  double offset_mm_max{0.2};
  double speed_mm_per_s{0.05};         ///< of an offset while all joints are homed
  double homing_speed_mm_per_s{1.0};   ///< joint: back to zero when a joint is un-homed
  double acceleration_mm_per_s2{0.5};  ///< while homed
  double homing_acceleration_mm_per_s2{20.0};
  std::string name{"thermocomp"};  ///< of the bridge's HAL component
  std::string command{"thermocomp-linuxcnc"};
  std::string arguments;  ///< of the bridge, besides --name and --axes
  std::string thread{"servo-thread"};
  int feedback_position{1};     ///< joint: place in the thread, after what reads the drives
  int output_position{-1};      ///< joint: -1 is last; before what writes the drives
  bool program_running{false};  ///< halui is loaded
  /// Pins of LinuxCNC that the machine's HAL files have put on a signal already: pin -> signal.
  std::map<std::string, std::string> signals;
};

class BadOption : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// @throws BadOption: no axis, an axis or joint twice, a letter or a number that cannot be
[[nodiscard]] std::string hal_file(const HalFileOptions& options);

/// For a bridge that ended while LinuxCNC runs, to be given to `halcmd -f`. After SIGTERM it can be
/// loaded again under its own name. After a kill its component cannot be had again before LinuxCNC
/// ends: another one, of another name, takes over its signals.
/// @param options  as for the file in use, but `name` is that of the bridge that ended
[[nodiscard]] std::string rejoin_file(const HalFileOptions& options, const std::string& name);

}  // namespace thermocomp_linuxcnc
