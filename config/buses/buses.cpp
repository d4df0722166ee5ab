#include "config/sections/buses.hpp"

#include <map>
#include <optional>

#include "config/sections/can_database.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"
#include "config/sections/j1939_bus.hpp"
#include "config/sections/modbus_values.hpp"

namespace thermocomp::sections {
namespace {

enum class BusKind { modbus_tcp, modbus_rtu, can, canopen, j1939, unknown };

struct Bus {
  BusKind kind{BusKind::unknown};
  std::size_t index{0};  ///< in the list of its kind
  TomlTable table;
  bool used{false};
};

struct Device {
  BusKind kind{BusKind::unknown};
  std::size_t bus{0};    ///< in the list of its kind
  std::size_t index{0};  ///< in its bus
  TomlTable table;
  bool used{false};
  const Preset* preset{nullptr};
};

/// What a preset must have been written for.
std::string protocol_of(BusKind kind) {
  switch (kind) {
    case BusKind::can:
      return "can";
    case BusKind::canopen:
      return "canopen";
    case BusKind::j1939:
      return "j1939";
    case BusKind::modbus_tcp:
    case BusKind::modbus_rtu:
    case BusKind::unknown:
      break;
  }
  return "modbus";
}

std::string known(const auto& entries) {
  std::string text;
  for (const auto& [name, entry] : entries) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "there is none" : text;
}

class BusReader {
 public:
  BusReader(const TomlTable& root, Presets& presets, DbcFiles& dbc_files, EdsFiles& eds_files)
      : root_(root), presets_(presets), dbc_files_(dbc_files), eds_files_(eds_files) {}

  SensorBuses read(const std::vector<TomlTable>& sensors) {
    std::set<std::string> bus_names;
    for (const TomlTable& table : root_.tables_required("bus")) read_bus(table, bus_names);
    std::set<std::string> device_names;
    for (const TomlTable& table : root_.tables_required("device")) {
      read_device(table, device_names);
    }
    for (std::size_t i = 0; i < sensors.size(); ++i) read_channel(sensors[i], i);
    for (const auto& [name, bus] : buses_) {
      if (!bus.used && !misnamed_bus_) bus.table.problem("name", "no device is on this bus");
    }
    for (const auto& [name, device] : devices_) {
      if (device.used) continue;
      if (!misnamed_device_) device.table.problem("name", "no sensor is on this device");
      device.table.ignore_rest();
    }
    drop_empty_buses();
    return std::move(result_);
  }

 private:
  /// Without files a device with a preset is left out; a bus of such devices only is none.
  void drop_empty_buses() {
    std::erase_if(result_.modbus, [](const auto& bus) { return bus.devices.empty(); });
    std::erase_if(result_.can, [](const auto& bus) { return bus.devices.empty(); });
    std::erase_if(result_.canopen, [](const auto& bus) { return bus.nodes.empty(); });
    std::erase_if(result_.j1939, [](const auto& bus) { return bus.nodes.empty(); });
  }

  void read_bus(const TomlTable& table, std::set<std::string>& names) {
    const std::string name = unique_name(table, names);
    const BusKind kind = table.choice<BusKind>("kind",
                                               {{"modbus_tcp", BusKind::modbus_tcp},
                                                {"modbus_rtu", BusKind::modbus_rtu},
                                                {"can", BusKind::can},
                                                {"canopen", BusKind::canopen},
                                                {"j1939", BusKind::j1939}},
                                               BusKind::unknown);
    Bus bus{kind, 0, table, false};
    if (kind == BusKind::can) {
      bus.index = result_.can.size();
      result_.can.push_back(read_can_bus(table, name));
      databases_.push_back(dbc_files_.read(table));
    } else if (kind == BusKind::canopen) {
      bus.index = result_.canopen.size();
      result_.canopen.push_back(read_canopen_bus(table, name));
    } else if (kind == BusKind::j1939) {
      bus.index = result_.j1939.size();
      result_.j1939.push_back(read_j1939_bus(table, name));
    } else if (kind == BusKind::unknown) {
      if (!table.has("kind")) table.problem("kind", "must be given");
      table.ignore_rest();
    } else {
      bus.index = result_.modbus.size();
      result_.modbus.push_back(read_modbus_bus(table, name, kind));
    }
    buses_.try_emplace(name, bus);
  }

  static CanBusConfig read_can_bus(const TomlTable& table, const std::string& name) {
    CanBusConfig bus;
    bus.name = name;
    bus.interface = read_interface(table);
    // Looking for an interface costs nothing, and a bus that is back shall be read within 2 s.
    bus.reconnect_s = table.number("reconnect_s", Range::between(0.01, 1), bus.reconnect_s);
    refuse_all(table,
               {"host", "port", "device", "baud", "parity", "data_bits", "stop_bits", "rs485",
                "timeout_ms", "inter_frame_delay_ms", "backoff_s_max", "retries"},
               "makes no sense for kind = \"can\"");
    return bus;
  }

  ModbusBusConfig read_modbus_bus(const TomlTable& table, const std::string& name, BusKind kind) {
    ModbusBusConfig bus;
    bus.name = name;
    bus.line = read_modbus_line(table, kind == BusKind::modbus_tcp);
    refuse_all(table, {"interface", "dbc"}, "makes no sense on a Modbus bus");
    if (const auto* rtu = std::get_if<ModbusRtu>(&bus.line.link)) {
      if (!rtu->device.empty() && !result_.serial_devices.insert(rtu->device).second) {
        table.problem("device", "is used by two buses");
      }
    }
    return bus;
  }

  void read_device(const TomlTable& own, std::set<std::string>& names) {
    const std::string name = unique_name(own, names);
    const std::string bus_name = own.text("bus");
    const auto bus = buses_.find(bus_name);
    Device device{BusKind::unknown, 0, 0, own, false};
    device.preset = presets_.of_device(own);
    if (bus == buses_.end()) {
      misnamed_bus_ = true;
      if (!bus_name.empty()) own.problem("bus", "must name a bus: " + known(buses_));
    } else if (own.has("preset") && device.preset == nullptr) {
      bus->second.used = true;  // what the device is like is not known
    } else {
      bus->second.used = true;
      device.kind = bus->second.kind;
      device.bus = bus->second.index;
      if (device.preset != nullptr) {
        device.table = Presets::over_preset(own, *device.preset, protocol_of(device.kind));
      }
    }
    read_kind_of_device(device, name);
    devices_.try_emplace(name, device);
  }

  void read_kind_of_device(Device& device, const std::string& name) {
    const TomlTable& table = device.table;
    switch (device.kind) {
      case BusKind::unknown:
        return table.ignore_rest();
      case BusKind::can:
        refuse_all(table,
                   {"unit", "period_s", "registers_per_request_max", "gap_registers_max",
                    "one_register_a_request", "renewal", "table", "encoding", "word_order"},
                   "makes no sense on a CAN bus");
        device.index = result_.can[device.bus].devices.size();
        result_.can[device.bus].devices.push_back({name, {}});
        return;
      case BusKind::canopen: {
        CanopenBusConfig& bus = result_.canopen[device.bus];
        const CanopenDevice& read =
            canopen_devices_.insert_or_assign(name, read_canopen_device(table, name, eds_files_))
                .first->second;
        check_canopen_node(table, bus, read.node);
        device.index = bus.nodes.size();
        bus.nodes.push_back(read.node);
        return;
      }
      case BusKind::j1939: {
        J1939BusConfig& bus = result_.j1939[device.bus];
        device.index = bus.nodes.size();
        bus.nodes.push_back(read_j1939_device(table, name, bus));
        return;
      }
      case BusKind::modbus_tcp:
      case BusKind::modbus_rtu:
        device.index = result_.modbus[device.bus].devices.size();
        result_.modbus[device.bus].devices.push_back(read_modbus_device(table, name, device.kind));
        return;
    }
  }

  static ModbusDeviceConfig read_modbus_device(const TomlTable& table, const std::string& name,
                                               BusKind kind) {
    ModbusDeviceConfig device;
    device.name = name;
    device.unit = read_unit(table, kind == BusKind::modbus_tcp);
    device.period_s = table.number("period_s", Range::between(0.01, 3600), device.period_s);
    device.registers_per_request_max =
        table.integer("registers_per_request_max", 1, 125, device.registers_per_request_max);
    device.gap_registers_max = table.integer("gap_registers_max", 0, 124, device.gap_registers_max);
    device.one_register_a_request =
        table.flag("one_register_a_request", device.one_register_a_request);
    if (table.has("renewal")) device.renewal = read_modbus_renewal(table.table("renewal"));
    return device;
  }

  void read_channel(const TomlTable& own, std::size_t index) {
    const std::string device_name = own.text("device");
    const auto found = devices_.find(device_name);
    if (found == devices_.end()) {
      misnamed_device_ = true;
      if (!device_name.empty()) own.problem("device", "must name a device: " + known(devices_));
      own.ignore_rest();
      return;
    }
    Device& device = found->second;
    device.used = true;
    const bool preset = device.preset != nullptr && device.kind != BusKind::unknown;
    const TomlTable sensor =
        preset ? Presets::over_channel(own, device.table, *device.preset) : own;
    read_channel_of(device, device_name, sensor, index);
  }

  void read_channel_of(const Device& device, const std::string& device_name,
                       const TomlTable& sensor, std::size_t index) {
    switch (device.kind) {
      case BusKind::unknown:
        return sensor.ignore_rest();
      case BusKind::can: {
        refuse_all(sensor, {"table", "address", "encoding", "word_order"},
                   "makes no sense on a CAN bus");
        CanChannel channel = read_can_channel(sensor, device.table, databases_[device.bus]);
        channel.sensor = index;
        result_.can[device.bus].devices[device.index].channels.push_back(std::move(channel));
        return;
      }
      case BusKind::canopen: {
        CanopenBusConfig& bus = result_.canopen[device.bus];
        auto channel = read_canopen_channel(sensor, device.table, canopen_devices_.at(device_name),
                                            eds_files_);
        if (!channel) return;
        channel->sensor = index;
        check_canopen_channel(sensor, bus, device.index, *channel);
        bus.nodes[device.index].channels.push_back(std::move(*channel));
        return;
      }
      case BusKind::j1939: {
        J1939Channel channel = read_j1939_channel(sensor, device.table);
        channel.sensor = index;
        result_.j1939[device.bus].nodes[device.index].channels.push_back(std::move(channel));
        return;
      }
      case BusKind::modbus_tcp:
      case BusKind::modbus_rtu: {
        ModbusDeviceConfig& modbus = result_.modbus[device.bus].devices[device.index];
        ModbusChannel channel = read_modbus_channel(sensor, device.table);
        channel.sensor = index;
        check_request(sensor, channel, modbus);
        modbus.channels.push_back(std::move(channel));
        return;
      }
    }
  }

  /// A value is read in one request, or it could be half old and half new.
  static void check_request(const TomlTable& sensor, const ModbusChannel& channel,
                            const ModbusDeviceConfig& device) {
    const auto count = static_cast<int>(words_of(channel.table, channel.encoding));
    if (count > device.registers_per_request_max) {
      sensor.problem("address", "the value takes " + std::to_string(count) +
                                    " registers, more than registers_per_request_max");
    }
  }

  TomlTable root_;
  Presets& presets_;
  DbcFiles& dbc_files_;
  EdsFiles& eds_files_;
  SensorBuses result_;
  std::vector<CanDatabase> databases_;  ///< one a CAN bus
  std::map<std::string, CanopenDevice> canopen_devices_;
  std::map<std::string, Bus> buses_;
  std::map<std::string, Device> devices_;
  /// A reference to a name that does not exist: whom nobody names may be the one that was meant.
  bool misnamed_bus_{false};
  bool misnamed_device_{false};
};

}  // namespace

SensorBuses read_buses(const TomlTable& root, const std::vector<TomlTable>& sensors,
                       Presets& presets, DbcFiles& dbc_files, EdsFiles& eds_files) {
  return BusReader(root, presets, dbc_files, eds_files).read(sensors);
}

}  // namespace thermocomp::sections
