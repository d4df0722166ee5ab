/// Scan with the daemon's own protocols above CAN.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "cli/scan/scan_bus.hpp"
#include "cli/scan/scan_can.hpp"
#include "drivers/can/can_protocol.hpp"
#include "drivers/can/can_socket.hpp"

namespace thermocomp::cli {

/// Reason for a missing value; empty if the device's note states it.
using Why = std::function<std::string(Fault, const RawReading&)>;

/// Channel of a reading.
struct Place {
  std::size_t device;
  std::size_t sensor;
  std::string text;
  Why why;
};

struct ProtocolBus {
  std::string name;
  BusOutline outline;
  std::vector<ScanDevice> devices;
  std::vector<Place> places;
};

/// Further search on the open bus, with the number of frames received by identifier.
using Afterwards = std::function<void(CanSocket&, const FrameCounts&, ScanBus&)>;

/// Runs the protocol for `task.listen_s` as the daemon would, and shows the value of each place.
[[nodiscard]] ScanBus scan_protocol(ProtocolBus what, CanProtocol& protocol,
                                    const ScanSensors& sensors, const ScanTask& task,
                                    const Afterwards& afterwards = nullptr);

/// Reason for a reading that the device marks as invalid.
inline constexpr const char* its_code = "the device's code for it";
[[nodiscard]] std::string too_few(const RawReading& raw);

}  // namespace thermocomp::cli
