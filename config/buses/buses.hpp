/// [[bus]], [[device]] and the place of each [[sensor]] on them. PROTOCOL_bus.cpp opens the
/// sections of a kind of bus.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/buses/database_files.hpp"
#include "config/buses/presets.hpp"
#include "config/sections/can_signals.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

/// A [[sensor]] on a device of the bus.
struct ChannelTables {
  TomlTable own;         ///< as in the file
  TomlTable sensor;      ///< merged over its channel of the preset, if any
  TomlTable device;      ///< as passed to read_device()
  std::size_t index{0};  ///< of the sensor in the configuration
  double stale_after_s{0.0};

  /// Requires that a reading as old as its period is not stale. @param period  its key, for the
  /// rule
  void check_period(double period_s, const std::string& period) const;
};

/// Files and records shared by the buses of a configuration.
struct BusFiles {
  DbcFiles& dbc;
  EdsFiles& eds;
  std::map<std::string, ModbusRtu> serial_lines;  ///< shared with a controller on the same line
  std::vector<Problem> remarks;                   ///< warnings, without the file's name
  std::map<std::string, std::string> places;      ///< by place: the first sensor, see note_place()
  /// By frame: its sensors, see note_bits().
  std::map<std::string, std::vector<std::pair<std::string, FrameBits>>> frames;

  void warn(const ChannelTables& tables, const std::string& text);
  /// Warns if two sensors read the same place. @param place  bus, device and number on it
  void note_place(const ChannelTables& tables, const std::string& place);
  /// Warns if two sensors share bits. @param frame  bus, identifier, page
  void note_bits(const ChannelTables& tables, const std::string& frame, const FrameBits& bits);
};

class BusSection {
 public:
  BusSection() = default;
  BusSection(const BusSection&) = delete;
  BusSection& operator=(const BusSection&) = delete;
  virtual ~BusSection() = default;

  /// @param table  the [[device]], merged over its preset if any
  virtual void read_device(const TomlTable& table, const std::string& name) = 0;
  /// @param device  counted in the order of read_device()
  virtual void read_channel(const ChannelTables& tables, std::size_t device) = 0;
  [[nodiscard]] virtual bool has_devices() const = 0;
  /// Leaves the section empty.
  [[nodiscard]] virtual BusConfig take() = 0;
};

/// Opens the section of a [[bus]] whose name and kind have been read.
using OpenBus = std::unique_ptr<BusSection>(const TomlTable& bus, const std::string& name,
                                            const std::string& kind, BusFiles& files);
OpenBus open_modbus, open_can, open_canopen, open_j1939;

struct BusKind {
  const char* name;      ///< value of the key `kind`
  const char* protocol;  ///< protocol of suitable presets
  OpenBus* open;
};
/// In the order in which the message about a wrong kind lists them.
[[nodiscard]] const std::vector<BusKind>& bus_kinds();

/// The [[sensor]] tables in order, with their sensors; channels get these indices.
struct SensorTables {
  const std::vector<TomlTable>& tables;
  std::span<const SensorConfig> sensors;
};

/// @param presets, files  the caller reports their problems
/// @return by kind, within a kind in file order
[[nodiscard]] std::vector<BusConfig> read_buses(const TomlTable& root, const SensorTables& sensors,
                                                Presets& presets, BusFiles& files);

}  // namespace thermocomp::sections
