/// A protocol above CAN in a scan: the daemon's own, worked for a while from here.
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

/// Why there is no value; empty where the device's note says it.
using Why = std::function<std::string(Fault, const RawReading&)>;

/// What a reading of the protocol is of.
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

/// A further search on the open bus; it is given the number of frames of each identifier heard.
using Afterwards = std::function<void(CanSocket&, const FrameCounts&, ScanBus&)>;

/// Works the protocol for `task.listen_s` as the daemon would, sends what it wants to send, and
/// shows what each place became.
[[nodiscard]] ScanBus scan_protocol(ProtocolBus what, CanProtocol& protocol,
                                    const ScanSensors& sensors, const ScanTask& task,
                                    const Afterwards& afterwards = nullptr);

/// "0x" and at least so many digits, after `before`.
[[nodiscard]] std::string hexadecimal(const char* before, std::uint32_t value, int digits);
/// Of a reading that the device itself calls none.
inline constexpr const char* its_code = "the device's code for it";
[[nodiscard]] std::string too_few(const RawReading& raw);

}  // namespace thermocomp::cli
