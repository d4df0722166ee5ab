// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/hal_pins.hpp"

#include <hal.h>
#include <new>

namespace thermocomp_linuxcnc {
namespace {

constexpr std::size_t axes_max = 6;

}  // namespace

struct HalPins::Pins {
  struct Axis {
    hal_float_t* applied;
    hal_float_t* wanted;
    hal_float_t* position;
    hal_float_t* offset;
  };
  Axis axes[axes_max];
  hal_bit_t* taking;
  hal_bit_t* enabled;
  hal_bit_t* homed;
  hal_bit_t* program_running;
  hal_s32_t* motion_type;
  hal_float_t* spindle_rpm;
  hal_bit_t* flood;
  hal_bit_t* mist;
  hal_bit_t* heartbeat;
  hal_bit_t* fresh;
  hal_bit_t* connected;
  hal_bit_t* compensating;
  hal_bit_t* mismatch;
  hal_bit_t* warning;
  hal_u32_t* faults;
};

HalPins::HalPins(const std::string& name, const std::string& axes, double unit_mm)
    : axes_(axes.size()), unit_mm_(unit_mm) {
  if (axes_ > axes_max) throw HalError("at most 6 axes");
  component_ = hal_init(name.c_str());
  if (component_ < 0)
    throw HalError("HAL does not take the component " + name +
                   " (is LinuxCNC running, is this its user, is the name taken?): code " +
                   std::to_string(component_));
  try {
    add_pins(name, axes);
  } catch (...) {
    hal_exit(component_);
    throw;
  }
}

HalPins::~HalPins() {
  hal_exit(component_);
}

void HalPins::add_pins(const std::string& name, const std::string& axes) {
  void* memory = hal_malloc(static_cast<long>(sizeof(Pins)));
  if (memory == nullptr) throw HalError("HAL has no memory left");
  pins_ = new (memory) Pins{};
  int code = 0;
  const auto made = [&](int result) { code = code != 0 ? code : result; };
  const auto bit = [&](hal_pin_dir_t direction, hal_bit_t** pin, const char* pin_name) {
    made(hal_pin_bit_newf(direction, pin, component_, "%s.%s", name.c_str(), pin_name));
  };
  for (std::size_t i = 0; i < axes_; ++i) {
    const auto pin = [&](hal_pin_dir_t direction, hal_float_t** place, const char* kind) {
      made(hal_pin_float_newf(direction, place, component_, "%s.%s-%c", name.c_str(), kind,
                              axes[i]));
    };
    pin(HAL_IN, &pins_->axes[i].applied, "applied");
    pin(HAL_IN, &pins_->axes[i].wanted, "wanted");
    pin(HAL_IN, &pins_->axes[i].position, "position");
    pin(HAL_OUT, &pins_->axes[i].offset, "offset");
  }
  bit(HAL_IN, &pins_->taking, "taking");
  bit(HAL_IN, &pins_->enabled, "enabled");
  bit(HAL_IN, &pins_->homed, "homed");
  bit(HAL_IN, &pins_->program_running, "program-running");
  bit(HAL_IN, &pins_->flood, "flood");
  bit(HAL_IN, &pins_->mist, "mist");
  made(hal_pin_s32_newf(HAL_IN, &pins_->motion_type, component_, "%s.motion-type", name.c_str()));
  made(hal_pin_float_newf(HAL_IN, &pins_->spindle_rpm, component_, "%s.spindle-rpm", name.c_str()));
  bit(HAL_OUT, &pins_->heartbeat, "heartbeat");
  bit(HAL_OUT, &pins_->fresh, "fresh");
  bit(HAL_OUT, &pins_->connected, "connected");
  bit(HAL_OUT, &pins_->compensating, "compensating");
  bit(HAL_OUT, &pins_->mismatch, "mismatch");
  bit(HAL_OUT, &pins_->warning, "warning");
  made(hal_pin_u32_newf(HAL_OUT, &pins_->faults, component_, "%s.faults", name.c_str()));
  if (code == 0) code = hal_ready(component_);
  if (code != 0) throw HalError("HAL refuses a pin: code " + std::to_string(code));
}

MachineView HalPins::read() const {
  MachineView view;
  view.taking = *pins_->taking;
  view.enabled = *pins_->enabled;
  view.homed = *pins_->homed;
  view.program_running = *pins_->program_running;
  view.motion_type = *pins_->motion_type;
  view.spindle_rpm = *pins_->spindle_rpm;
  view.flood = *pins_->flood;
  view.mist = *pins_->mist;
  for (std::size_t i = 0; i < axes_; ++i) {
    const Pins::Axis& axis = pins_->axes[i];
    view.axes.push_back(
        {*axis.applied * unit_mm_, *axis.wanted * unit_mm_, *axis.position * unit_mm_});
  }
  return view;
}

void HalPins::write(const Outputs& outputs, bool connected) {
  for (std::size_t i = 0; i < axes_; ++i)
    if (outputs.offset_mm[i]) *pins_->axes[i].offset = *outputs.offset_mm[i] / unit_mm_;
  *pins_->fresh = outputs.fresh;
  *pins_->connected = connected;
  *pins_->compensating = outputs.compensating;
  *pins_->mismatch = outputs.mismatch;
  *pins_->warning = outputs.warning;
  *pins_->faults = outputs.faults;
  *pins_->heartbeat = outputs.heartbeat;  // last, after the values that it confirms
}

}  // namespace thermocomp_linuxcnc
