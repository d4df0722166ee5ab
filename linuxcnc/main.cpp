// SPDX-License-Identifier: GPL-2.0-or-later
#include <cstdio>
#include <exception>
#include <iostream>

#include "linuxcnc/bridge.hpp"
#include "linuxcnc/command_line.hpp"

int main(int argc, char** argv) {
  using namespace thermocomp_linuxcnc;
  int status = 0;
  try {
    const auto task = read_command_line(argc, argv, status);
    if (!task) return status;
    if (!task->print_hal)
      run_bridge(task->bridge);
    else
      std::cout << (task->rejoin_as.empty() ? hal_file(task->hal)
                                            : rejoin_file(task->hal, task->rejoin_as));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp-linuxcnc: %s\n", error.what());
    return 2;
  }
}
