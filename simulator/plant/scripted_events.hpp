/// Effects of scripted events on channels, units and controller at a plant time.
#pragma once

#include <optional>
#include <vector>

#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

struct ChannelEffect {
  std::optional<ChannelFault> fault;
  std::optional<std::int64_t> code;  ///< none: the device's first for the fault
  bool frozen{false};
  double added_K{0.0};
};

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
  std::size_t rehomings{0};  ///< number until now
};

struct Effects {
  std::vector<std::vector<ChannelEffect>> channels;  ///< (devices, channels of the device)
  std::vector<UnitEffect> devices;
  std::vector<UnitEffect> buses;
  UnitEffect controller_unit;
  ControllerEffect controller;
};

/// Channel fault of this kind of event; nullopt for other kinds.
[[nodiscard]] std::optional<ChannelFault> channel_fault(MachineEventKind kind);

/// An event is active in [at_s, at_s + duration_s).
[[nodiscard]] Effects effects_at(const MachineConfig& machine, double plant_time_s);

}  // namespace thermocomp
