#include "config/buses/j1939_bus.hpp"

#include <charconv>
#include <optional>

#include "config/buses/buses.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

constexpr int node_address_max = 253;
constexpr int bytes_max = 1785;
constexpr std::int64_t pgn_max = 0x3FFFF;
constexpr std::int64_t first_broadcast_format = 240;

const Names<Fault>& fault_names() {
  static const Names<Fault> names{
      {"open_circuit", Fault::open_circuit}, {"short_circuit", Fault::short_circuit},
      {"out_of_range", Fault::out_of_range}, {"no_answer", Fault::no_answer},
      {"device_busy", Fault::device_busy},   {"device_error", Fault::device_error}};
  return names;
}

/// A NAME has 64 bits, but TOML's integers 63: it is written as text.
std::optional<std::uint64_t> read_name(const TomlTable& table, const char* key) {
  constexpr std::size_t digits_max = 16;
  if (!table.has(key)) return std::nullopt;
  const std::string text = table.text(key);
  std::uint64_t name = 0;
  const bool prefixed = text.starts_with("0x") && text.size() <= digits_max + 2;
  if (prefixed) {
    const char* end = text.data() + text.size();
    const auto [stopped, error] = std::from_chars(text.data() + 2, end, name, 16);
    if (error == std::errc{} && stopped == end) return name;
  }
  if (!text.empty()) table.problem(key, "must be a NAME such as \"0x80FF001200345678\"");
  return std::nullopt;
}

/// An integer in `own` or else `base`. Both are checked.
int whole(const TomlTable& own, const TomlTable& base, std::string_view key, int low, int high) {
  const bool in_base = base.has(key);
  if (!own.has(key) && !in_base) own.problem(key, "must be given");
  return own.integer(key, low, high, base.integer(key, low, high, low));
}

Fault read_meaning(const TomlTable& own, const TomlTable& base, std::string_view key) {
  return own.choice(key, fault_names(), base.choice(key, fault_names(), Fault::device_error));
}

}  // namespace

J1939BusConfig read_j1939_bus(const TomlTable& table, const std::string& name) {
  J1939BusConfig bus;
  bus.name = name;
  bus.interface = read_interface(table);
  bus.reconnect_s = table.number("reconnect_s", Range::between(0.01, 1), bus.reconnect_s);
  if (table.has("own_address")) {
    bus.own_address = table.integer("own_address", 0, node_address_max, 0);
    if (!table.has("own_name")) table.problem("own_name", "must be given with own_address");
  }
  bus.own_name = read_name(table, "own_name").value_or(0);
  return bus;
}

J1939NodeConfig read_j1939_device(const TomlTable& table, const std::string& name,
                                  const J1939BusConfig& bus) {
  J1939NodeConfig node;
  node.name = name;
  if (table.has("address")) node.address = table.integer("address", 0, node_address_max, 0);
  node.name_claimed = read_name(table, "j1939_name");
  if (!table.has("address") && !table.has("j1939_name")) {
    table.problem("address", "must be given, or j1939_name");
  }
  if (node.address && node.address == bus.own_address) {
    table.problem("address", "is our own (own_address of the bus)");
  }
  for (const J1939NodeConfig& other : bus.nodes) {
    if (node.address && other.address == node.address) {
      table.problem("address", "is already that of the device " + other.name);
    }
    if (node.name_claimed && other.name_claimed == node.name_claimed) {
      table.problem("j1939_name", "is already that of the device " + other.name);
    }
  }
  // Reported already; completes the node for what is built from it.
  if (!node.address && !node.name_claimed) node.address = 0;
  return node;
}

J1939Channel read_j1939_channel(const TomlTable& sensor, const TomlTable& device) {
  J1939Channel channel;
  J1939Parameter& parameter = channel.parameter;
  parameter.pgn = static_cast<std::uint32_t>(whole(sensor, device, "pgn", 0, pgn_max));
  const bool is_addressed = ((parameter.pgn >> 8) & 0xFFu) < first_broadcast_format;
  if (is_addressed && (parameter.pgn & 0xFFu) != 0) {
    sensor.problem("pgn", std::to_string(parameter.pgn),
                   "a group that is sent to one node has 0 in its lowest byte");
    parameter.pgn &= ~0xFFu;
  }
  parameter.start_byte = sensor.integer("start_byte", 1, bytes_max) - 1;
  parameter.start_bit = sensor.integer("start_bit", 1, 8, 1) - 1;
  parameter.length_bits = whole(sensor, device, "length_bits", 2, 32);
  if (8 * parameter.start_byte + parameter.start_bit + parameter.length_bits > 8 * bytes_max) {
    sensor.problem("start_byte", "the parameter must end within 1785 bytes");
    parameter.start_byte = 0;
  }
  parameter.scale = read_scale(sensor, read_scale(device, 1.0));
  const Range range = Range::between(-1e4, 1e4);
  parameter.offset = sensor.number("offset_degC", range, device.number("offset_degC", range, 0.0));
  CanSignal unsigned_field;
  unsigned_field.length_bits = parameter.length_bits;
  unsigned_field.is_signed = false;
  parameter.sentinels = read_can_codes(sensor, device, unsigned_field);
  parameter.error = read_meaning(sensor, device, "error_means");
  parameter.not_available = read_meaning(sensor, device, "not_available_means");
  return channel;
}

namespace {

class J1939Section final : public BusSection {
 public:
  J1939Section(const TomlTable& table, const std::string& name, BusFiles& files)
      : bus_(read_j1939_bus(table, name)), files_(files) {}

  void read_device(const TomlTable& table, const std::string& name) override {
    bus_.nodes.push_back(read_j1939_device(table, name, bus_));
  }

  void read_channel(const ChannelTables& tables, std::size_t device) override {
    J1939Channel channel = read_j1939_channel(tables.sensor, tables.device);
    channel.sensor = tables.index;
    const J1939Parameter& place = channel.parameter;
    const auto first = static_cast<std::size_t>(8 * place.start_byte + place.start_bit);
    FrameBits bits;  // one part of the group, as long as a frame
    for (std::size_t i = first % bits.size(); i < bits.size(); ++i)
      bits.set(i, i < first % bits.size() + static_cast<std::size_t>(place.length_bits));
    files_.note_bits(tables,
                     bus_.nodes[device].name + ' ' + std::to_string(place.pgn) + ' ' +
                         std::to_string(first / bits.size()),
                     bits);
    bus_.nodes[device].channels.push_back(std::move(channel));
  }

  [[nodiscard]] bool has_devices() const override { return !bus_.nodes.empty(); }
  [[nodiscard]] BusConfig take() override { return std::move(bus_); }

 private:
  J1939BusConfig bus_;
  BusFiles& files_;
};

}  // namespace

std::unique_ptr<BusSection> open_j1939(const TomlTable& bus, const std::string& name,
                                       const std::string& /*kind*/, BusFiles& files) {
  return std::make_unique<J1939Section>(bus, name, files);
}

}  // namespace thermocomp::sections
