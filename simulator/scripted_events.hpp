/// What the script of events does to channels, units and controller at a plant time. Pure.
#pragma once

#include <optional>
#include <vector>

#include "simulator/machine_config.hpp"

namespace thermocomp {

struct ChannelEffect {
  bool open_circuit{false};
  bool frozen{false};
  double added_K{0.0};
};

/// What befalls a bus, a device or the controller.
struct UnitEffect {
  bool silent{false};  ///< drop
  bool down{false};    ///< reboot
  bool garbage{false};
  bool frozen{false};
  double delay_ms{0.0};
  std::optional<int> exception;
};

struct ControllerEffect {
  bool rejects{false};
  double misapplied_um{0.0};
  std::size_t rehomings{0};  ///< so many times until now
};

struct Effects {
  std::vector<std::vector<ChannelEffect>> channels;  ///< (devices, channels of the device)
  std::vector<UnitEffect> devices;
  std::vector<UnitEffect> buses;
  UnitEffect controller_unit;
  ControllerEffect controller;
};

/// An event is in force from at_s until before at_s + duration_s.
[[nodiscard]] Effects effects_at(const MachineConfig& machine, double plant_time_s);

}  // namespace thermocomp
