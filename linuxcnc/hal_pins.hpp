// SPDX-License-Identifier: GPL-2.0-or-later
/// The bridge's HAL component: reads and writes its pins, which are in the machine's unit.
#pragma once

#include <stdexcept>
#include <string>

#include "linuxcnc/bridge_state.hpp"
#include "linuxcnc/messages.hpp"

namespace thermocomp_linuxcnc {

class HalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class HalPins {
 public:
  /// Creates the component with its pins and marks it ready.
  /// @param unit_mm  the machine's unit [mm]
  /// @throws HalError
  HalPins(const std::string& name, const std::string& axes, double unit_mm);
  ~HalPins();  ///< leaves HAL, so that the component can be loaded again
  HalPins(const HalPins&) = delete;
  HalPins& operator=(const HalPins&) = delete;

  [[nodiscard]] MachineView read() const;
  void write(const Outputs& outputs, bool connected);

 private:
  struct Pins;  ///< in HAL's memory
  void add_pins(const std::string& name, const std::string& axes);

  int component_{-1};
  std::size_t axes_;
  double unit_mm_;
  Pins* pins_{nullptr};
};

}  // namespace thermocomp_linuxcnc
