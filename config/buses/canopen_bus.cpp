#include "config/buses/canopen_bus.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "config/buses/buses.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

constexpr int node_max = 127;
constexpr std::uint32_t cob_id_max = 0x7FF;

const Names<ObjectType>& type_names() {
  static const Names<ObjectType> names{
      {"bool", {1, false, false}},    {"int8", {8, true, false}},
      {"int16", {16, true, false}},   {"int24", {24, true, false}},
      {"int32", {32, true, false}},   {"int64", {64, true, false}},
      {"uint8", {8, false, false}},   {"uint16", {16, false, false}},
      {"uint24", {24, false, false}}, {"uint32", {32, false, false}},
      {"uint64", {64, false, false}}, {"real32", {32, true, true}},
      {"real64", {64, true, true}}};
  return names;
}

/// CiA 301 reserves the other identifiers for other services.
bool can_be_tpdo(std::uint32_t cob_id) {
  return (cob_id > 0x100 && cob_id < 0x580) || (cob_id >= 0x680 && cob_id < 0x6E0);
}

struct Place {
  std::optional<ObjectAddress> object;
  std::optional<ObjectType> type;  ///< from the data sheet
  bool unknown{false};             ///< the name or its type cannot be resolved; reported
};

/// Valid names: full ones, and parts after the '/'.
std::vector<std::string> short_and_long_names(const EdsFile& eds) {
  std::vector<std::string> names = eds.names();
  for (std::size_t i = 0, count = names.size(); i < count; ++i) {
    const std::size_t slash = names[i].find('/');
    if (slash != std::string::npos) names.push_back(names[i].substr(slash + 1));
  }
  return names;
}

/// Marks the flaws of an object whose type is not configured as used; without an object, the flaws
/// outside of objects.
void mark_flaws(EdsFile& eds, const TomlTable& table, std::optional<ObjectAddress> object) {
  for (EdsFlaw& flaw : eds.flaws) {
    if (flaw.object != object || (object && table.has("type"))) continue;
    if (object && !flaw.in_use) flaw.problem.rule += "; type in the configuration replaces it";
    flaw.in_use = true;
  }
}

Place by_name(const TomlTable& table, const CanopenDevice& known, const EdsFiles& eds_files) {
  Place place;
  const std::string name = table.text("object");
  refuse_all(table, {"index", "sub"}, "cannot be combined with object");
  if (name.empty()) return place;
  if (!known.eds) {
    place.unknown = true;
    if (eds_files.opens_files() && !known.names_eds)
      table.problem("object", "needs the data sheet of its device: eds");
    return place;
  }
  const auto found = known.eds->find(name);
  if (found.size() == 1) {
    place.object = found.front()->address;
    place.type = found.front()->type;
    mark_flaws(*known.eds, table, place.object);
    place.unknown = !place.type && !table.has("type");
    if (place.unknown) table.problem("object", "is not a number in the data sheet; give its type");
    return place;
  }
  place.unknown = true;
  if (!found.empty()) {
    table.problem("object", "is ambiguous: " + found[0]->name + " or " + found[1]->name);
    return place;
  }
  mark_flaws(*known.eds, table, std::nullopt);
  const std::string near = nearest_name(name, short_and_long_names(*known.eds));
  std::string rule = "is not an object of the data sheet";
  if (!near.empty()) rule.append("; did you mean ").append(near).append("?");
  table.problem("object", rule);
  return place;
}

ObjectAddress read_address(const TomlTable& table) {
  return {table.integer<std::uint16_t>("index", 0, 0xFFFF, 0),
          table.integer<std::uint8_t>("sub", 0, 0xFE, 0)};
}

/// Reads `object`, or `index` and `sub`.
Place read_object(const TomlTable& table, const CanopenDevice& known, const EdsFiles& eds_files) {
  if (table.has("object")) return by_name(table, known, eds_files);
  Place place;
  if (!table.has("index")) return place;
  place.object = read_address(table);
  if (known.eds) {
    const EdsObject* object = known.eds->find(*place.object);
    if (object != nullptr) place.type = object->type;
    mark_flaws(*known.eds, table, place.object);
  }
  return place;
}

std::uint32_t default_cob_id(int pdo, int node) {
  return static_cast<std::uint32_t>(0x80 + 0x100 * pdo + node);
}

/// Reads `cob_id`, or `pdo` with the node's default identifiers; 0 if both are missing.
std::uint32_t read_cob_id(const TomlTable& own, const TomlTable& base, int node) {
  const bool has_own = own.has("cob_id") || own.has("pdo");
  const TomlTable& table = has_own ? own : base;
  if (table.has("cob_id")) {
    table.refuse("pdo", "cannot be combined with cob_id");
    const auto cob_id = table.integer<std::uint32_t>("cob_id", 0, cob_id_max, 0);
    if (!can_be_tpdo(cob_id)) {
      table.problem("cob_id", "is kept for other messages; a TPDO is in [0x101, 0x57F]");
    }
    return cob_id;
  }
  if (!table.has("pdo")) return 0;
  return default_cob_id(table.integer("pdo", 1, 4, 1), node);
}

CanopenWrite read_write(const TomlTable& table, const CanopenDevice& known,
                        const EdsFiles& eds_files) {
  CanopenWrite write;
  const Place place = read_object(table, known, eds_files);
  if (!place.object && !table.has("object")) table.problem("index", "must be given, or object");
  write.object = place.object.value_or(ObjectAddress{});
  const ObjectType type = table.choice("type", type_names(), place.type.value_or(ObjectType{}));
  if (!place.type && !place.unknown && !table.has("type")) table.problem("type", "must be given");
  const int bits = type.length_bits;
  write.bytes.resize(static_cast<std::size_t>((std::min(bits, 32) + 7) / 8));
  if (bits > 32) {
    table.problem("type", "must have at most 32 bits");
    table.ignore_rest();
    return write;
  }
  std::uint64_t raw = 0;
  if (type.is_float) {
    raw = std::bit_cast<std::uint32_t>(
        static_cast<float>(table.number("value", Range::between(-1e30, 1e30))));
  } else {
    const std::int64_t span = std::int64_t{1} << bits;
    const std::int64_t low = type.is_signed ? -span / 2 : 0;
    raw = static_cast<std::uint64_t>(table.integer<std::int64_t>("value", low, low + span - 1));
  }
  for (std::size_t i = 0; i < write.bytes.size(); ++i) {
    write.bytes[i] = static_cast<std::uint8_t>(raw >> (8 * i));
  }
  return write;
}

CanopenMapping read_mapping(const TomlTable& table, int node) {
  CanopenMapping mapping;
  mapping.cob_id = read_cob_id(table, table, node);
  if (!table.has("cob_id") && !table.has("pdo")) table.problem("pdo", "must be given, or cob_id");
  int bits = 0;
  for (const TomlTable& entry : table.tables_required("object")) {
    if (!entry.has("index")) entry.problem("index", "must be given");
    mapping.objects.push_back({read_address(entry), entry.integer("length_bits", 1, 64)});
    bits += mapping.objects.back().length_bits;
  }
  if (bits > 64) table.problem("object", "take " + std::to_string(bits) + " bits of 64");
  return mapping;
}

std::vector<std::uint16_t> read_emergency_codes(const TomlTable& own, const TomlTable& base) {
  const TomlTable& table = own.has("emergency_codes") ? own : base;
  std::vector<std::uint16_t> codes;
  for (const std::int64_t code : table.integers("emergency_codes", 0x0100, 0xFFFF, {})) {
    codes.push_back(static_cast<std::uint16_t>(code));
  }
  return codes;
}

/// The status is in the value's TPDO, or an object of its own that is requested after the value.
void read_status(const TomlTable& sensor, const TomlTable& device, CanopenChannel& channel) {
  const TomlTable& source = sensor.has("status") ? sensor : device;
  if (!source.has("status")) return;
  if (channel.way == CanopenWay::pdo_bits) {
    channel.signal.status = read_can_status(sensor, device, false);
    return;
  }
  const TomlTable table = source.table("status");
  if (channel.way == CanopenWay::pdo_object) {
    source.problem("status", "needs a value with start_bit, or an object with poll_s");
    table.ignore_rest();
    return;
  }
  if (!table.has("index")) table.problem("index", "must be given");
  CanopenStatus status;
  status.object = read_address(table);
  status.number = read_status_numbers(table, {0, table.integer("length_bits", 1, 32, 8)});
  channel.status = std::move(status);
}

/// Reads the source: object with a period of requests, object of a mapping, or place in a TPDO.
void read_way(const TomlTable& sensor, const TomlTable& device, const CanopenDevice& known,
              const Place& place, CanopenChannel& channel) {
  const bool polled = sensor.has("poll_s") || (device.has("poll_s") && !sensor.has("start_bit"));
  if (place.object || place.unknown) {
    channel.object = place.object.value_or(ObjectAddress{});
    refuse_all(sensor, {"start_bit", "cob_id", "pdo"}, "cannot be combined with an object");
    channel.way = polled ? CanopenWay::sdo : CanopenWay::pdo_object;
    const Range range = Range::between(0.02, 3600.0);
    channel.poll_s = sensor.number("poll_s", range, device.number("poll_s", range, 1.0));
    const CanopenNodeConfig& node = known.node;
    if (!polled && !place.unknown && node.mappings_read.empty() && node.mappings.empty()) {
      sensor.problem(sensor.has("object") ? "object" : "index",
                     "needs mappings of its device: read_mappings or mapping; or poll_s");
    }
    return;
  }
  channel.way = CanopenWay::pdo_bits;
  sensor.refuse("poll_s", "needs an object");
  if (!sensor.has("start_bit")) {
    sensor.problem("start_bit", "must be given, or an object (object, or index and sub)");
  }
  channel.signal.id = read_cob_id(sensor, device, known.node.node);
  if (channel.signal.id == 0) sensor.problem("pdo", "must be given, or cob_id");
  channel.signal.start_bit = sensor.integer("start_bit", 0, 63, 0);
}

}  // namespace

EmergencyForm read_emergency_form(const TomlTable& device) {
  return device.choice<EmergencyForm>(
      "emergency", {{"generic", EmergencyForm::generic}, {"jumo_cantrans", EmergencyForm::jumo}},
      EmergencyForm::generic);
}

CanopenBusConfig read_canopen_bus(const TomlTable& table, const std::string& name) {
  CanopenBusConfig bus;
  bus.name = name;
  bus.interface = read_interface(table);
  bus.reconnect_s = table.number("reconnect_s", Range::between(0.01, 1), bus.reconnect_s);
  bus.start_nodes = table.flag("start_nodes", bus.start_nodes);
  if (table.has("own_node")) bus.own_node = table.integer("own_node", 1, node_max, node_max);
  const Range period = Range::between(0.01, 60.0);
  if (table.has("heartbeat_s") && bus.own_node == 0) {
    table.problem("heartbeat_s", "needs own_node");
  }
  bus.heartbeat_s = table.number("heartbeat_s", period, bus.heartbeat_s);
  if (table.has("sync_s")) bus.sync_s = table.number("sync_s", period);
  bus.sdo_timeout_s = table.number("sdo_timeout_s", Range::between(0.01, 10.0), bus.sdo_timeout_s);
  return bus;
}

CanopenDevice read_canopen_device(const TomlTable& table, const std::string& name,
                                  EdsFiles& eds_files) {
  CanopenDevice device;
  CanopenNodeConfig& node = device.node;
  node.name = name;
  device.names_eds = table.has("eds");
  device.eds = eds_files.read(table);
  node.node = table.integer("node", 1, node_max);
  const Range period = Range::between(0.01, 60.0);
  if (table.has("heartbeat_s")) node.heartbeat_s = table.number("heartbeat_s", period);
  const double otherwise_s = 3.0 * node.heartbeat_s;
  node.heartbeat_timeout_s =
      table.number("heartbeat_timeout_s", Range::between(0.02, 3600.0), otherwise_s);
  if (!(node.heartbeat_timeout_s > node.heartbeat_s) && node.heartbeat_s > 0.0) {
    table.problem("heartbeat_timeout_s", "must be more than heartbeat_s");
  }
  if (table.has("pdo_period_s")) node.pdo_period_s = table.number("pdo_period_s", period);
  node.pdo_on_change = table.flag("pdo_on_change", node.pdo_on_change);
  if (node.pdo_on_change && !(node.heartbeat_timeout_s > 0.0)) {
    table.problem("pdo_on_change", "needs heartbeat_s, or heartbeat_timeout_s");
  }
  node.emergency = read_emergency_form(table);
  for (const TomlTable& entry : table.tables("write")) {
    node.writes.push_back(read_write(entry, device, eds_files));
  }
  for (const TomlTable& entry : table.tables("mapping")) {
    CanopenMapping mapping = read_mapping(entry, node.node);
    const auto& known = node.mappings;
    if (std::any_of(known.begin(), known.end(),
                    [&](const CanopenMapping& each) { return each.cob_id == mapping.cob_id; })) {
      entry.problem(entry.has("cob_id") ? "cob_id" : "pdo", std::to_string(mapping.cob_id),
                    "is already the COB-ID of a TPDO of this device");
    }
    node.mappings.push_back(std::move(mapping));
  }
  for (const std::int64_t number : table.integers("read_mappings", 1, 512, {})) {
    const int pdo = static_cast<int>(number);
    const auto& read = node.mappings_read;
    if (std::find(read.begin(), read.end(), pdo) != read.end()) {
      table.problem("read_mappings", std::to_string(pdo), "is listed twice");
    } else {
      node.mappings_read.push_back(pdo);
    }
  }
  return device;
}

std::optional<CanopenChannel> read_canopen_channel(const TomlTable& sensor, const TomlTable& device,
                                                   const CanopenDevice& known,
                                                   const EdsFiles& eds_files) {
  CanopenChannel channel;
  const Place place = read_object(sensor, known, eds_files);
  const ObjectType in_base = device.choice("type", type_names(), place.type.value_or(ObjectType{}));
  const ObjectType type = sensor.choice("type", type_names(), place.type.value_or(in_base));
  if (!place.type && !place.unknown && !sensor.has("type") && !device.has("type")) {
    sensor.problem("type", "must be given");
  }
  channel.signal.length_bits = type.length_bits;
  channel.signal.is_signed = type.is_signed && !type.is_float;
  channel.signal.is_float = type.is_float;
  read_way(sensor, device, known, place, channel);
  read_status(sensor, device, channel);
  if (channel.signal.start_bit + type.length_bits > 64) {
    sensor.problem("start_bit", "the value must end within 8 bytes");
    channel.signal.start_bit = 0;
  }
  channel.signal.scale = read_scale(sensor, read_scale(device, 1.0));
  const Range range = Range::between(-1e4, 1e4);
  channel.signal.offset =
      sensor.number("offset_degC", range, device.number("offset_degC", range, 0.0));
  channel.signal.sentinels = read_can_codes(sensor, device, channel.signal);
  channel.emergency_codes = read_emergency_codes(sensor, device);
  if (sensor.has("emergency_channel")) {
    channel.emergency_channel = sensor.integer("emergency_channel", 1, 255, 1);
    if (known.node.emergency == EmergencyForm::generic) {
      sensor.problem("emergency_channel", "needs a device whose emergency messages name channels");
    }
  }
  if (place.unknown) return std::nullopt;
  return channel;
}

void check_canopen_node(const TomlTable& device, const CanopenBusConfig& bus,
                        const CanopenNodeConfig& node) {
  if (node.node == bus.own_node) device.problem("node", "is our own (own_node of the bus)");
  for (const CanopenNodeConfig& other : bus.nodes) {
    if (other.node == node.node) {
      device.problem("node", "is already that of the device " + other.name);
    }
    for (const CanopenMapping& a : other.mappings) {
      for (const CanopenMapping& b : node.mappings) {
        if (a.cob_id != b.cob_id) continue;
        device.problem("mapping", std::to_string(a.cob_id),
                       "is already the COB-ID of a TPDO of the device " + other.name);
      }
    }
  }
}

void check_canopen_channel(const TomlTable& sensor, const CanopenBusConfig& bus, std::size_t node,
                           const CanopenChannel& channel) {
  if (channel.way != CanopenWay::pdo_bits || channel.signal.id == 0) return;
  for (std::size_t i = 0; i < bus.nodes.size(); ++i) {
    if (i == node) continue;
    const CanopenNodeConfig& other = bus.nodes[i];
    const bool in_channel =
        std::any_of(other.channels.begin(), other.channels.end(), [&](const CanopenChannel& each) {
          return each.way == CanopenWay::pdo_bits && each.signal.id == channel.signal.id;
        });
    const bool in_mapping =
        std::any_of(other.mappings.begin(), other.mappings.end(),
                    [&](const CanopenMapping& each) { return each.cob_id == channel.signal.id; });
    if (!in_channel && !in_mapping) continue;
    sensor.problem(sensor.has("cob_id") ? "cob_id" : "pdo", std::to_string(channel.signal.id),
                   "is already the COB-ID of a TPDO of the device " + other.name);
    return;
  }
}

namespace {

class CanopenSection final : public BusSection {
 public:
  CanopenSection(const TomlTable& table, const std::string& name, BusFiles& files)
      : bus_(read_canopen_bus(table, name)), files_(files) {}

  void read_device(const TomlTable& table, const std::string& name) override {
    devices_.push_back(read_canopen_device(table, name, files_.eds));
    check_canopen_node(table, bus_, devices_.back().node);
    bus_.nodes.push_back(devices_.back().node);
  }

  void read_channel(const ChannelTables& tables, std::size_t device) override {
    auto channel = read_canopen_channel(tables.sensor, tables.device, devices_[device], files_.eds);
    if (!channel) return;
    channel->sensor = tables.index;
    const std::string place = bus_.nodes[device].name + ' ';
    if (channel->way == CanopenWay::pdo_bits)
      files_.note_bits(tables, place + std::to_string(channel->signal.id),
                       frame_bits(channel->signal));
    else
      files_.note_place(tables, place + std::to_string(channel->object.index) + ' ' +
                                    std::to_string(channel->object.sub));
    check_canopen_channel(tables.sensor, bus_, device, *channel);
    if (channel->way == CanopenWay::sdo) tables.check_period(channel->poll_s, "poll_s");
    bus_.nodes[device].channels.push_back(std::move(*channel));
  }

  [[nodiscard]] bool has_devices() const override { return !bus_.nodes.empty(); }
  [[nodiscard]] BusConfig take() override { return std::move(bus_); }

 private:
  CanopenBusConfig bus_;
  BusFiles& files_;
  std::vector<CanopenDevice> devices_;
};

}  // namespace

std::unique_ptr<BusSection> open_canopen(const TomlTable& bus, const std::string& name,
                                         const std::string& /*kind*/, BusFiles& files) {
  return std::make_unique<CanopenSection>(bus, name, files);
}

}  // namespace thermocomp::sections
