#include "config/buses/buses.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <memory>

#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

/// Kind of the bus; nullptr, with a problem, if missing or unknown.
const BusKind* read_kind(const TomlTable& table) {
  Names<const BusKind*> names;
  for (const BusKind& kind : bus_kinds()) names.emplace_back(kind.name, &kind);
  const BusKind* kind = table.choice<const BusKind*>("kind", names, nullptr);
  if (!table.has("kind")) table.problem("kind", "must be given");
  return kind;
}

struct Bus {
  const BusKind* kind{nullptr};         ///< nullptr: unknown
  std::shared_ptr<BusSection> section;  ///< nullptr: unknown kind
  TomlTable table;
  std::size_t devices{0};
  bool used{false};
};

struct Device {
  std::shared_ptr<BusSection> section;  ///< nullptr: the device is not known
  std::size_t index{0};                 ///< within its bus
  TomlTable table;
  bool used{false};
  const Preset* preset{nullptr};
};

std::string known(const auto& entries) {
  std::string text;
  for (const auto& [name, entry] : entries) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "there is none" : text;
}

class BusReader {
 public:
  BusReader(const TomlTable& root, Presets& presets, BusFiles& files)
      : root_(root), presets_(presets), files_(files) {}

  std::vector<BusConfig> read(const SensorTables& sensors) {
    std::set<std::string> bus_names;
    for (const TomlTable& table : root_.tables_required("bus")) read_bus(table, bus_names);
    std::set<std::string> device_names;
    for (const TomlTable& table : root_.tables_required("device")) {
      read_device(table, device_names);
    }
    for (std::size_t i = 0; i < sensors.tables.size(); ++i) {
      read_channel(sensors.tables[i], i, sensors.sensors[i].screening.stale_after_s);
    }
    for (const auto& [name, bus] : buses_) {
      if (!bus.used && !misnamed_bus_)
        bus.table.problem("name", "no device is on this bus: enter a module or leave the bus out");
    }
    for (const auto& [name, device] : devices_) {
      if (device.used) continue;
      if (!misnamed_device_) device.table.problem("name", "no sensor is on this device");
      device.table.ignore_rest();
    }
    return take();
  }

 private:
  /// Without files, devices with a preset are omitted, and so are buses that have no other devices.
  std::vector<BusConfig> take() {
    std::vector<BusConfig> buses;
    for (const std::shared_ptr<BusSection>& section : sections_)
      if (section->has_devices()) buses.push_back(section->take());
    std::stable_sort(buses.begin(), buses.end(),
                     [](const BusConfig& a, const BusConfig& b) { return a.index() < b.index(); });
    return buses;
  }

  void read_bus(const TomlTable& table, std::set<std::string>& names) {
    const std::string name = unique_name(table, names);
    Bus bus{read_kind(table), nullptr, table, 0, false};
    if (bus.kind == nullptr) {
      table.ignore_rest();
    } else {
      bus.section = bus.kind->open(table, name, bus.kind->name, files_);
      sections_.push_back(bus.section);
    }
    buses_.try_emplace(name, bus);
  }

  void read_device(const TomlTable& own, std::set<std::string>& names) {
    const std::string name = unique_name(own, names);
    const std::string bus_name = own.text("bus");
    const auto bus = buses_.find(bus_name);
    Device device{nullptr, 0, own, false, presets_.of_device(own)};
    if (bus == buses_.end()) {
      misnamed_bus_ = true;
      if (!bus_name.empty()) own.problem("bus", "must name a bus: " + known(buses_));
    } else if (own.has("preset") && device.preset == nullptr) {
      bus->second.used = true;  // used by a device that is not known
    } else {
      bus->second.used = true;
      place_on(bus->second, device, name);
    }
    if (device.section == nullptr) {
      (device.preset == nullptr ? own : own.over(device.preset->device)).ignore_rest();
    }
    devices_.try_emplace(name, device);
  }

  static void place_on(Bus& bus, Device& device, const std::string& name) {
    if (bus.section == nullptr) return;
    if (device.preset != nullptr) {
      device.table = Presets::over_preset(device.table, *device.preset, bus.kind->protocol);
    }
    device.section = bus.section;
    device.index = bus.devices++;
    device.section->read_device(device.table, name);
  }

  void read_channel(const TomlTable& own, std::size_t index, double stale_after_s) {
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
    if (device.section == nullptr) return own.ignore_rest();
    const TomlTable sensor =
        device.preset != nullptr ? Presets::over_channel(own, device.table, *device.preset) : own;
    device.section->read_channel({own, sensor, device.table, index, stale_after_s}, device.index);
  }

  TomlTable root_;
  Presets& presets_;
  BusFiles& files_;
  std::vector<std::shared_ptr<BusSection>> sections_;  ///< in file order
  std::map<std::string, Bus> buses_;
  std::map<std::string, Device> devices_;
  /// After a reference to an unknown name, an unused bus or device is not reported.
  bool misnamed_bus_{false};
  bool misnamed_device_{false};
};

}  // namespace

void ChannelTables::check_period(double period_s, const std::string& period) const {
  if (stale_after_s > period_s) return;
  own.problem("screening.stale_after_s", std::to_string(stale_after_s),
              "must be more than " + period);
}

void BusFiles::note_place(const ChannelTables& tables, const std::string& place) {
  const std::string name = tables.own.text("name", "");
  const auto [found, is_new] = places.emplace(place, name);
  if (!is_new) warn(tables, "reads the same value as sensor[" + found->second + "]");
}

void BusFiles::note_bits(const ChannelTables& tables, const std::string& frame,
                         const FrameBits& bits) {
  auto& known = frames[frame];
  for (const auto& [sensor, taken] : known) {
    if ((taken & bits).none()) continue;
    const std::string what = taken == bits ? "reads the same value as" : "shares bits with";
    warn(tables, what + " sensor[" + sensor + "]");
    break;
  }
  known.emplace_back(tables.own.text("name", ""), bits);
}

void BusFiles::warn(const ChannelTables& tables, const std::string& text) {
  remarks.push_back({"", tables.own.line(), tables.own.path(), "", text});
}

const std::vector<BusKind>& bus_kinds() {
  static const std::vector<BusKind> kinds = [] {
    std::vector<BusKind> all;
    const auto add = [&all](const char* protocol, const auto& names, OpenBus* open) {
      for (const char* name : names) all.push_back({name, protocol, open});
    };
    add("modbus", ModbusBusConfig::kinds, open_modbus);
    add("can", CanBusConfig::kinds, open_can);
    add("canopen", CanopenBusConfig::kinds, open_canopen);
    add("j1939", J1939BusConfig::kinds, open_j1939);
    return all;
  }();
  return kinds;
}

std::vector<BusConfig> read_buses(const TomlTable& root, const SensorTables& sensors,
                                  Presets& presets, BusFiles& files) {
  return BusReader(root, presets, files).read(sensors);
}

}  // namespace thermocomp::sections
