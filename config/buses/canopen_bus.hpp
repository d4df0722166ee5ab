/// The parts of the daemon's file that describe a CANopen bus, its nodes and their objects.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/bus_files/eds_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp::sections {

/// The electronic data sheets of a configuration.
class EdsFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and objects by name are
  /// left out
  explicit EdsFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `eds` of a device; nullptr: it names none, or none that can be read.
  [[nodiscard]] std::shared_ptr<const EdsFile> read(const TomlTable& device);
  [[nodiscard]] bool opens_files() const noexcept { return folder_.has_value(); }
  /// What is wrong inside the files.
  [[nodiscard]] const std::vector<Problem>& problems() const noexcept { return problems_; }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<const EdsFile>> read_;
  std::vector<Problem> problems_;
};

/// A node and its data sheet.
struct CanopenDevice {
  CanopenNodeConfig node;
  bool names_eds{false};
  std::shared_ptr<const EdsFile> eds;  ///< nullptr: none is named, or it cannot be read
};

/// What the emergency messages of the device say.
[[nodiscard]] EmergencyForm read_emergency_form(const TomlTable& device);

[[nodiscard]] CanopenBusConfig read_canopen_bus(const TomlTable& table, const std::string& name);
[[nodiscard]] CanopenDevice read_canopen_device(const TomlTable& table, const std::string& name,
                                                EdsFiles& eds_files);
/// nullopt: it is an object by name, and no data sheet says which.
/// What `sensor` leaves out is as in `device`.
[[nodiscard]] std::optional<CanopenChannel> read_canopen_channel(const TomlTable& sensor,
                                                                 const TomlTable& device,
                                                                 const CanopenDevice& known,
                                                                 const EdsFiles& eds_files);
/// That a TPDO belongs to one node. @param device  the table of `node`, the last of the bus' nodes
void check_canopen_node(const TomlTable& device, const CanopenBusConfig& bus,
                        const CanopenNodeConfig& node);
/// ... also where a sensor names it. @param node  position in the bus
void check_canopen_channel(const TomlTable& sensor, const CanopenBusConfig& bus, std::size_t node,
                           const CanopenChannel& channel);

}  // namespace thermocomp::sections
