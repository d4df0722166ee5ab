/// [[bus]], [[device]] and where each [[sensor]] is found on them. A kind's file PROTOCOL_bus.cpp
/// opens the sections of its buses.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/buses/database_files.hpp"
#include "config/buses/presets.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

/// A [[sensor]] on a device of the bus.
struct ChannelTables {
  TomlTable own;         ///< as it stands in the file
  TomlTable sensor;      ///< over its channel of the preset, if the device has one
  TomlTable device;      ///< as read_device() was given it
  std::size_t index{0};  ///< of the sensor in the configuration
  double stale_after_s{0.0};

  /// Checks that a reading as old as its period is not stale yet. @param period  the key, for the
  /// rule
  void check_period(double period_s, const std::string& period) const;
};

/// Database files that several buses of a configuration read.
struct BusFiles {
  DbcFiles& dbc;
  EdsFiles& eds;
  std::map<std::string, ModbusRtu> serial_lines;  ///< of buses; a controller on one shares it
  std::vector<Problem> remarks;                   ///< oddities that forbid nothing; without file
  std::map<std::string, std::string> places;      ///< sensor that reads it, by note_place()

  /// Remarks on two sensors that read one place. @param place  bus, device and number on it
  void note_place(const ChannelTables& tables, const std::string& place);
};

class BusSection {
 public:
  BusSection() = default;
  BusSection(const BusSection&) = delete;
  BusSection& operator=(const BusSection&) = delete;
  virtual ~BusSection() = default;

  /// @param table  the [[device]], over its preset if it has one
  virtual void read_device(const TomlTable& table, const std::string& name) = 0;
  /// @param device  counted in the order of read_device()
  virtual void read_channel(const ChannelTables& tables, std::size_t device) = 0;
  [[nodiscard]] virtual bool has_devices() const = 0;
  /// Afterwards the section is empty.
  [[nodiscard]] virtual BusConfig take() = 0;
};

/// Opens the section of a [[bus]] whose keys name, kind are read.
using OpenBus = std::unique_ptr<BusSection>(const TomlTable& bus, const std::string& name,
                                            const std::string& kind, BusFiles& files);
OpenBus open_modbus, open_can, open_canopen, open_j1939;

struct BusKind {
  const char* name;      ///< in the key `kind`
  const char* protocol;  ///< what a preset must have been written for
  OpenBus* open;
};
/// In the order in which the message about a wrong kind names them.
[[nodiscard]] const std::vector<BusKind>& bus_kinds();

/// The [[sensor]] tables in order, and what was read of them; their channels get these indices.
struct SensorTables {
  const std::vector<TomlTable>& tables;
  std::span<const SensorConfig> sensors;
};

/// @param presets, files  the caller reports their problems
/// @return by kind, those of one kind as in the file
[[nodiscard]] std::vector<BusConfig> read_buses(const TomlTable& root, const SensorTables& sensors,
                                                Presets& presets, BusFiles& files);

}  // namespace thermocomp::sections
