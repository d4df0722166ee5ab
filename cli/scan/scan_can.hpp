/// One CAN bus, listened to for a while.
#pragma once

#include <functional>
#include <string>

#include "cli/scan/scan_modbus.hpp"
#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"

namespace thermocomp::cli {

/// "0x281"
[[nodiscard]] std::string id_name(const CanId& id);
/// "0x281 bit 7 length 16 big_endian x 0.01"
[[nodiscard]] std::string place_name(const CanSignal& signal);

/// The controller's frames: what of `applied` and signals they carry. Nothing is sent, so that what
/// the daemon sends is not among the values.
[[nodiscard]] ScanController scan_can_controller(
    const DaemonConfig& config, const CanControllerConfig& controller, double listen_s,
    const std::function<void(const std::string&)>& progress);

/// Listens for `listen_s` seconds and sends nothing. Every channel gets the newest frame that
/// carries its signal; where none came, the identifiers that did come are named.
[[nodiscard]] ScanBus scan_can(const CanBusConfig& config, const ScanSensors& sensors,
                               double listen_s,
                               const std::function<void(const std::string&)>& progress);

/// The same for the protocols above CAN. A CANopen bus is worked as the daemon would work it: the
/// nodes are set up, started and asked as the configuration says. On a J1939 bus NAMEs are asked
/// for, and our own is claimed if the configuration has one.
/// @param find_nodes  asks every node number for its object 1000 (device type) afterwards
[[nodiscard]] ScanBus scan_canopen(const CanopenBusConfig& config, const ScanSensors& sensors,
                                   double listen_s, bool find_nodes,
                                   const std::function<void(const std::string&)>& progress);
[[nodiscard]] ScanBus scan_j1939(const J1939BusConfig& config, const ScanSensors& sensors,
                                 double listen_s,
                                 const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
