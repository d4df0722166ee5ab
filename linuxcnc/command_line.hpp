// SPDX-License-Identifier: GPL-2.0-or-later
/// Command line options of thermocomp-linuxcnc.
#pragma once

#include <optional>
#include <string>

#include "linuxcnc/bridge_state.hpp"
#include "linuxcnc/hal_file.hpp"

namespace thermocomp_linuxcnc {

struct BridgeOptions {
  std::string name{"thermocomp"};
  std::string axes{"xyz"};
  std::string socket{"/run/thermocomp/status.sock"};
  double period_s{0.05};
  std::string unit;  ///< of the machine, in which HAL's pins are: mm or inch
  Limits limits;
};

struct Task {
  bool print_hal{false};
  BridgeOptions bridge;
  HalFileOptions hal;
  std::string rejoin_as;  ///< not empty: print the file for another component to take over
};

/// Prints help, version or errors as needed.
/// @return nullopt: exit with `status`
[[nodiscard]] std::optional<Task> read_command_line(int argc, const char* const* argv, int& status);

/// "x=0,z=2" @throws BadOption
[[nodiscard]] std::vector<HalAxis> read_axes(const std::string& text);

}  // namespace thermocomp_linuxcnc
