/// Sections of the daemon's file for a CANopen bus, its nodes and objects.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "config/buses/database_files.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp::sections {

/// A node with its data sheet.
struct CanopenDevice {
  CanopenNodeConfig node;
  bool names_eds{false};
  std::shared_ptr<EdsFile> eds;  ///< nullptr: not configured, or unreadable
};

/// Format of the device's emergency messages.
[[nodiscard]] EmergencyForm read_emergency_form(const TomlTable& device);

[[nodiscard]] CanopenBusConfig read_canopen_bus(const TomlTable& table, const std::string& name);
[[nodiscard]] CanopenDevice read_canopen_device(const TomlTable& table, const std::string& name,
                                                EdsFiles& eds_files);
/// Keys missing in `sensor` are taken from `device`.
/// @return nullopt: the object is given by name and not found in a data sheet
[[nodiscard]] std::optional<CanopenChannel> read_canopen_channel(const TomlTable& sensor,
                                                                 const TomlTable& device,
                                                                 const CanopenDevice& known,
                                                                 const EdsFiles& eds_files);
/// Checks that a TPDO belongs to one node. @param device  the table of `node`, the bus' last node
void check_canopen_node(const TomlTable& device, const CanopenBusConfig& bus,
                        const CanopenNodeConfig& node);
/// The same for the TPDO of a sensor. @param node  index in the bus
void check_canopen_channel(const TomlTable& sensor, const CanopenBusConfig& bus, std::size_t node,
                           const CanopenChannel& channel);

}  // namespace thermocomp::sections
