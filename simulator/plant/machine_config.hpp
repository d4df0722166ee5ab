/// The whole simulated machine as its file gives it: body, buses, devices, controller, events.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/can/can_config.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/modbus/modbus_config.hpp"
#include "simulator/plant/field_node_config.hpp"
#include "simulator/plant/plant_config.hpp"

namespace thermocomp {

enum class SimulatedBusKind { modbus_tcp, modbus_rtu, can };

struct SimulatedBus {
  std::string name;
  SimulatedBusKind kind{SimulatedBusKind::modbus_tcp};
  std::string host{"127.0.0.1"};  ///< address to listen at
  int port{0};                    ///< 0: any free one, named when ready
  std::string device;             ///< RTU: a symbolic link to the pty is put here
  int baud{9600};
  bool line_delay{false};     ///< RTU: bytes take the time that the baud rate implies
  double turnaround_ms{0.0};  ///< a unit thinks so long before it answers
  std::string interface;      ///< CAN
};

/// A register or bit beside a value; it has `good` in the bits of its mask while all is well.
struct SimulatedStatus {
  ModbusTable table{ModbusTable::discrete_input};
  std::uint16_t address{0};
  std::uint16_t mask{0xFFFF};
  std::uint16_t good{0};
  FaultCodes codes;
};

/// One measured value in a device's registers or frames.
struct SimulatedChannel {
  std::string name;    ///< what events call it
  std::string column;  ///< of the plant or of the replayed run file
  ModbusValue place;   ///< value = raw * scale + offset_degC
  double offset_degC{0.0};
  CanSignal can;                      ///< on a CAN bus instead of `place`
  std::optional<CanField> counter{};  ///< in its frame, counts conversions
  FaultCodes codes;                   ///< in place of the value
  std::optional<SimulatedStatus> status;
  CanStatusCodes can_status{};  ///< numbers of the status that `can` has
};

struct SimulatedDevice {
  std::string name;
  std::size_t bus{0};
  int unit{1};
  double period_s{0.02};                 ///< converts (CAN: sends) every so often, real time
  std::optional<ModbusRenewal> renewal;  ///< counts conversions
  std::vector<SimulatedChannel> channels;
};

struct SimulatedControllerSignal {
  std::string name;  ///< column
  ModbusValue place;
  CanSignal can;
  std::optional<double> value;  ///< shown where no column of that name exists
  /// An output: shows what is left of it at the tool, displacement and offset together, as a probe
  /// would find it.
  std::optional<std::string> probe_of{};
  double noise_um{0.0};  ///< standard deviation of the probe
};

/// The axis is a stacked piezo: its register is a voltage.
struct SimulatedPiezoConfig {
  double dead_band_V{0.0};       ///< after each turn nothing moves for so long
  std::vector<double> curve_V;   ///< felt by the stack; begins with 0, both strictly increase
  std::vector<double> curve_um;  ///< displacement then
};

/// The controller interpolates along the travel: by the position that it has itself, as often as
/// it looks at it.
struct SimulatedTravel {
  ModbusTravel registers;
  std::string position;                    ///< column of the plant
  double interpolation_um_per_s_max{0.0};  ///< real time; 0: at once
  std::optional<CanTravel> frames{};       ///< on CAN instead of `registers`
  double frame_age_s_max{1.0};             ///< CAN: an older frame is part of no set

  [[nodiscard]] const TravelShape& shape() const noexcept {
    return frames ? static_cast<const TravelShape&>(*frames) : registers;
  }
};

struct SimulatedAxis {
  std::string name;
  std::string output;             ///< displacement that this axis' offset acts on
  double sign{1.0};               ///< -1: the controller counts offsets the other way
  double offset_um_max{0.0};      ///< what the controller is willing to apply; 0: anything
  double rate_um_per_s_max{0.0};  ///< how fast, real time; 0: at once
  ModbusValue offset;
  std::optional<ModbusValue> applied;
  CanSignal can_offset;
  std::optional<CanSignal> can_applied;
  std::optional<SimulatedPiezoConfig> piezo{};
  std::optional<SimulatedTravel> travel{};  ///< in place of `offset` and `applied`

  /// How many offsets it takes.
  [[nodiscard]] std::size_t offsets() const noexcept {
    return travel ? travel->shape().nodes_mm.size() : 1;
  }
};

struct SimulatedController {
  SimulatedBus bus;
  int unit{1};
  double period_s{0.05};            ///< CAN: sends every so often, real time
  double tau_s{0.0};                ///< first-order approach to the offset, real time; 0: at once
  double heartbeat_timeout_s{2.0};  ///< real time; 0: not watched
  std::optional<ModbusValue> valid_bits;
  std::optional<ModbusValue> heartbeat;
  std::optional<CanSignal> can_valid_bits;
  std::optional<CanSignal> can_heartbeat;
  std::vector<SimulatedAxis> axes;
  std::vector<SimulatedControllerSignal> signals;
};

enum class MachineEventKind {
  open_circuit,  ///< a channel's thermocouple is broken
  short_circuit,
  over_range,
  under_range,
  channel_error,  ///< the device says that it cannot measure the channel
  freeze,         ///< a channel, or all of a device, shows its last value for ever
  spike,          ///< a channel shows change_K too much
  drift,          ///< a channel departs at rate_K_per_h
  drop,           ///< no answer, no frame
  delay,          ///< the answer comes delay_ms late
  garbage,        ///< the answer is random bytes
  exception,      ///< the answer is Modbus exception `code`
  reboot,         ///< connections closed; nothing for the duration; a controller forgets its offset
  reject,         ///< the controller answers, but leaves the offset as it is
  misapply,       ///< the controller applies change_um more than was sent
  rehome          ///< the controller's applied offset falls to zero until it is written anew
};

enum class TargetKind { channel, device, bus, controller };

struct EventConfig {
  MachineEventKind kind{MachineEventKind::drop};
  TargetKind target{TargetKind::device};
  std::size_t device{0};  ///< of a channel or device
  std::size_t channel{0};
  std::size_t bus{0};
  double at_s{0.0};        ///< plant time
  double duration_s{0.0};  ///< plant time
  double change_K{0.0};
  double change_um{0.0};
  double rate_K_per_h{0.0};
  double delay_ms{0.0};  ///< real time
  int code{6};
  std::optional<std::int64_t> channel_code;  ///< of a channel's fault; none: the first listed
};

struct MachineConfig {
  std::uint64_t seed{1};
  double duration_s{0.0};            ///< plant time; 0: until stopped
  double pitch_s{10.0};              ///< of simulated run files and truth files, plant time
  std::optional<PlantConfig> plant;  ///< none: such a machine can only replay a run file
  std::vector<SimulatedBus> buses;
  std::vector<SimulatedDevice> devices;
  std::optional<SimulatedController> controller;
  std::vector<EventConfig> events;
  std::vector<SimulatedNode> field_nodes;  ///< by kind, those of one kind as in the file
};

}  // namespace thermocomp
