/// The parts of the daemon's file that describe a CANopen bus, its nodes and their objects.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "config/buses/database_files.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp::sections {

/// A node and its data sheet.
struct CanopenDevice {
  CanopenNodeConfig node;
  bool names_eds{false};
  std::shared_ptr<EdsFile> eds;  ///< nullptr: none is named, or it cannot be read
};

/// What the emergency messages of the device say.
[[nodiscard]] EmergencyForm read_emergency_form(const TomlTable& device);

[[nodiscard]] CanopenBusConfig read_canopen_bus(const TomlTable& table, const std::string& name);
[[nodiscard]] CanopenDevice read_canopen_device(const TomlTable& table, const std::string& name,
                                                EdsFiles& eds_files);
/// nullopt: the object is given by name, and no data sheet says which it is.
/// What `sensor` leaves out is as in `device`.
[[nodiscard]] std::optional<CanopenChannel> read_canopen_channel(const TomlTable& sensor,
                                                                 const TomlTable& device,
                                                                 const CanopenDevice& known,
                                                                 const EdsFiles& eds_files);
/// Checks that a TPDO belongs to one node. @param device  the table of `node`, the last of the bus'
/// nodes
void check_canopen_node(const TomlTable& device, const CanopenBusConfig& bus,
                        const CanopenNodeConfig& node);
/// The same where a sensor names the TPDO. @param node  position in the bus
void check_canopen_channel(const TomlTable& sensor, const CanopenBusConfig& bus, std::size_t node,
                           const CanopenChannel& channel);

}  // namespace thermocomp::sections
