/// Configuration of the simulated machine: body, buses, devices, controller, events.
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
  std::string host{"127.0.0.1"};  ///< listening address
  int port{0};                    ///< 0: any free port, printed in the ready line
  std::string device;             ///< RTU: path of the symbolic link to the pty
  int baud{9600};
  bool line_delay{false};     ///< RTU: simulates the duration of bytes at the baud rate
  double turnaround_ms{0.0};  ///< delay of a unit's answer
  std::string interface;      ///< CAN
};

/// Status register or bit of a value; the bits of its mask equal `good` without a fault.
struct SimulatedStatus {
  ModbusTable table{ModbusTable::discrete_input};
  std::uint16_t address{0};
  std::uint16_t mask{0xFFFF};
  std::uint16_t good{0};
  FaultCodes codes;
};

struct SimulatedChannel {
  std::string name;    ///< name in events
  std::string column;  ///< of the plant or of the replayed run file
  ModbusValue place;   ///< value = raw * scale + offset_degC
  double offset_degC{0.0};
  CanSignal can;                      ///< on CAN instead of `place`
  std::optional<CanField> counter{};  ///< counts conversions in its frame
  FaultCodes codes;                   ///< instead of the value
  std::optional<SimulatedStatus> status;
  CanStatusCodes can_status{};  ///< codes of the status in `can`
};

struct SimulatedDevice {
  std::string name;
  std::size_t bus{0};
  int unit{1};
  double period_s{0.02};                 ///< period of conversions (CAN: of frames), real time
  std::optional<ModbusRenewal> renewal;  ///< counts conversions
  std::vector<SimulatedChannel> channels;
};

struct SimulatedControllerSignal {
  std::string name;  ///< column
  ModbusValue place;
  CanSignal can;
  std::optional<double> value;  ///< shown if there is no column of that name
  /// Output measured by a probe: displacement plus offset at the tool.
  std::optional<std::string> probe_of{};
  double noise_um{0.0};  ///< probe's standard deviation
};

/// Stacked piezo as the axis' drive; its register is a voltage.
struct SimulatedPiezoConfig {
  double dead_band_V{0.0};       ///< no motion for this range after each turn
  std::vector<double> curve_V;   ///< effective voltage; begins with 0; both lists strictly increase
  std::vector<double> curve_um;  ///< displacement at curve_V
};

/// The controller interpolates along the travel at its own position, in its own cycle.
struct SimulatedTravel {
  ModbusTravel registers;
  std::string position;                    ///< column of the plant
  double interpolation_um_per_s_max{0.0};  ///< real time; 0: at once
  std::optional<CanTravel> frames{};       ///< on CAN instead of `registers`
  double frame_age_s_max{1.0};             ///< CAN: older frames do not complete a set

  [[nodiscard]] const TravelShape& shape() const noexcept {
    return frames ? static_cast<const TravelShape&>(*frames) : registers;
  }
};

struct SimulatedAxis {
  std::string name;
  std::string output;             ///< displacement that the axis' offset changes
  double sign{1.0};               ///< -1: the controller's positive direction is opposite
  double offset_um_max{0.0};      ///< controller's bound; 0: none
  double rate_um_per_s_max{0.0};  ///< controller's slew limit, real time; 0: none
  ModbusValue offset;
  std::optional<ModbusValue> applied;
  CanSignal can_offset;
  std::optional<CanSignal> can_applied;
  std::optional<SimulatedPiezoConfig> piezo{};
  std::optional<SimulatedTravel> travel{};  ///< instead of `offset` and `applied`

  [[nodiscard]] std::size_t offsets() const noexcept {
    return travel ? travel->shape().nodes_mm.size() : 1;
  }
};

struct SimulatedController {
  SimulatedBus bus;
  int unit{1};
  double period_s{0.05};            ///< CAN: period of frames, real time
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
  open_circuit,  ///< broken thermocouple of a channel
  short_circuit,
  over_range,
  under_range,
  channel_error,  ///< the device reports a measuring error of the channel
  freeze,         ///< a channel or device holds its last value
  spike,          ///< a channel's value is change_K too high
  drift,          ///< a channel drifts by rate_K_per_h
  drop,           ///< no answer, no frame
  delay,          ///< the answer comes delay_ms late
  garbage,        ///< the answer is random bytes
  exception,      ///< the answer is Modbus exception `code`
  reboot,         ///< connections close, silence for the duration; a controller loses its offset
  reject,         ///< the controller answers without changing the offset
  misapply,       ///< the controller applies the offset plus change_um
  rehome          ///< the controller's offset is zero until written again
};

enum class TargetKind { channel, device, bus, controller };

struct EventConfig {
  MachineEventKind kind{MachineEventKind::drop};
  TargetKind target{TargetKind::device};
  std::size_t device{0};  ///< target, or the channel's device
  std::size_t channel{0};
  std::size_t bus{0};
  double at_s{0.0};        ///< plant time
  double duration_s{0.0};  ///< plant time
  double change_K{0.0};
  double change_um{0.0};
  double rate_K_per_h{0.0};
  double delay_ms{0.0};  ///< real time
  int code{6};
  std::optional<std::int64_t> channel_code;  ///< code of a channel's fault; none: the first listed
};

struct MachineConfig {
  std::uint64_t seed{1};
  double duration_s{0.0};            ///< plant time; 0: until stopped
  double pitch_s{10.0};              ///< sample pitch of simulated run and truth files, plant time
  std::optional<PlantConfig> plant;  ///< none: the machine can only replay a run file
  std::vector<SimulatedBus> buses;
  std::vector<SimulatedDevice> devices;
  std::optional<SimulatedController> controller;
  std::vector<EventConfig> events;
  std::vector<SimulatedNode> field_nodes;  ///< by kind, then in the file's order
};

}  // namespace thermocomp
