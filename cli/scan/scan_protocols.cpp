// CANopen and J1939 in a scan: the daemon's own protocol, worked for a while from here.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <poll.h>
#include <set>
#include <span>

#include "cli/scan/scan_can.hpp"
#include "drivers/can/can_protocol.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/can/signal_codec.hpp"
#include "drivers/monotonic_clock.hpp"

namespace thermocomp::cli {
namespace {

std::string hexadecimal(const char* before, std::uint32_t value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%s0x%0*X", before, digits, value);
  return text;
}

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

struct Worked {
  std::vector<Reading> readings;
  std::vector<RawReading> raw;
  std::vector<UnitHealth> units;
  std::map<CanId, std::size_t> frames;
  nanoseconds ended_at{};
};

/// Feeds the protocol with the bus for `listen_s`, and sends what it wants to send.
Worked work(CanProtocol& protocol, CanSocket& socket, double listen_s) {
  Worked worked;
  const nanoseconds end = monotonic_now() + from_seconds(listen_s);
  protocol.opened(monotonic_now());
  while (socket.is_open() && monotonic_now() < end) {
    pollfd wait{socket.descriptor(), POLLIN, 0};
    constexpr int slice_ms = 10;
    static_cast<void>(::poll(&wait, 1, slice_ms));
    for (const CanFrame& frame : socket.receive()) {
      ++worked.frames[frame.id];
      protocol.take(frame);
    }
    protocol.advance(monotonic_now());
    while (const auto frame = protocol.next_frame()) {
      if (!socket.send(*frame)) break;
    }
  }
  worked.ended_at = monotonic_now();
  worked.readings.assign(protocol.readings().begin(), protocol.readings().end());
  worked.raw = protocol.raw();
  worked.units = protocol.health(worked.ended_at);
  return worked;
}

std::string heard_text(const Worked& worked) {
  constexpr std::size_t text_max = 200;
  std::string text = "identifiers on the bus:";
  for (const auto& [id, count] : worked.frames) {
    text.append(hexadecimal(" ", id.id, id.extended ? 8 : 3)).append(" (");
    text.append(std::to_string(count)).append(")");
    if (text.size() > text_max) return text + " ...";
  }
  if (worked.frames.empty()) {
    text = "not a single frame came: bit rate, termination (two of 120 Ohm), or nobody sends";
  }
  return text;
}

std::string raw_text(const RawReading& raw) {
  std::string text = hex_bytes(raw.value);
  if (!raw.status.empty()) text += ", status " + hex_bytes(raw.status);
  return text;
}

constexpr const char* its_code = "the device's code for it";

bool has_code(const std::vector<Sentinel>& sentinels, std::int64_t code) {
  return std::any_of(sentinels.begin(), sentinels.end(),
                     [&](const Sentinel& each) { return each.code == code; });
}

std::string too_few(const RawReading& raw) {
  return "only " + std::to_string(raw.value.size()) + " bytes came";
}

/// Why bytes that came are no value. What the bytes do not say the node said otherwise.
std::string why_not(const CanopenChannel& channel, Fault fault, const RawReading& raw) {
  if (fault == Fault::bad_frame) return too_few(raw);
  CanSignal value = channel.signal;
  value.status.reset();
  if (channel.way != CanopenWay::pdo_bits) value.start_bit = 0;
  if (decode(raw.value, value).fault == fault) return its_code;
  std::optional<CanStatus> status = channel.signal.status;
  std::vector<std::uint8_t> bytes = raw.value;
  if (channel.status) {
    status = channel.status->number;
    bytes = raw.status;
  }
  if (status && bytes.size() >= bytes_needed(status->field)) {
    const std::uint64_t number = extract_raw(bytes, status->field);
    if (fault_of(*status, number) == fault) {
      return hexadecimal("the status beside it is ", static_cast<std::uint32_t>(number), 2);
    }
  }
  return "the bytes would be a value, but the node is in trouble, see above";
}

std::string why_not(const J1939Parameter& parameter, Fault fault, const RawReading& raw) {
  constexpr std::size_t frame_bytes = 8;
  if (fault == Fault::bad_frame) return too_few(raw);
  J1939Parameter place = parameter;
  const auto bytes = static_cast<std::size_t>((place.start_bit + place.length_bits + 7) / 8);
  if (static_cast<std::size_t>(place.start_byte) + bytes > frame_bytes &&
      raw.value.size() <= frame_bytes) {
    place.start_byte = 0;  // of a longer group only its bytes are there
  }
  const std::uint64_t number = extract_raw(raw.value, place);
  if (has_code(place.sentinels, static_cast<std::int64_t>(number))) return its_code;
  constexpr std::uint64_t not_available = 0xFF;
  constexpr std::uint64_t error = 0xFE;
  if (place.length_bits % 8 != 0) return "a message of the standard, no value";
  const std::uint64_t top = number >> (place.length_bits - 8);
  if (top == not_available) return "the standard's \"not available\"";
  return top == error ? "the standard's \"error\"" : "beyond the standard's range for values";
}

/// Why there is no value; empty where the device's note says it.
using Why = std::function<std::string(Fault, const RawReading&)>;

ScanChannel show(const Reading& reading, const RawReading& raw, const Why& why, nanoseconds now,
                 const PlausibleRange& range) {
  ScanChannel result;
  result.fault = reading.fault;
  result.temp_degC = reading.temp_degC;
  result.raw = raw_text(raw);
  if (reading.taken_at != nanoseconds{0}) {
    result.age_s = static_cast<double>((now - reading.taken_at).count()) * 1e-9;
  }
  if (reading.fault != Fault::none) {
    result.why = raw.value.empty() ? "nothing came that carries it" : why(reading.fault, raw);
    return result;
  }
  if (reading.temp_degC >= range.min_degC && reading.temp_degC <= range.max_degC) return result;
  result.fault = Fault::out_of_range;
  result.why = number_text(reading.temp_degC) + " degC is no temperature of [" +
               number_text(range.min_degC) + ", " + number_text(range.max_degC) + "] ([screening])";
  result.hints.emplace_back("compare type, scale and place with the manual");
  return result;
}

constexpr int nodes_max = 127;

/// An SDO request to read object 1000, which every node has.
CanFrame device_type_request(int node) {
  constexpr std::uint32_t request_base = 0x600;
  CanFrame frame;
  frame.id = {request_base + static_cast<std::uint32_t>(node), false};
  frame.size = 8;
  frame.data[0] = 0x40;
  frame.data[2] = 0x10;
  return frame;
}

/// Notes who answers or shows itself by a heartbeat, until `end`.
void collect_nodes(CanSocket& socket, nanoseconds end, std::set<int>& nodes) {
  constexpr std::uint32_t answer_base = 0x580;
  constexpr std::uint32_t heartbeat_base = 0x700;
  do {
    pollfd wait{socket.descriptor(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, 2));
    for (const CanFrame& frame : socket.receive()) {
      const std::uint32_t node = frame.id.id & 0x7FU;
      const std::uint32_t base = frame.id.id - node;
      if (frame.id.extended || node == 0) continue;
      if (base == answer_base || base == heartbeat_base) nodes.insert(static_cast<int>(node));
    }
  } while (socket.is_open() && monotonic_now() < end);
}

void find_canopen_nodes(const CanopenBusConfig& config, CanSocket& socket, ScanBus& bus,
                        const std::function<void(const std::string&)>& progress) {
  progress("bus " + config.name +
           ": asking nodes 1 to 127 for object 1000 (SDO), one frame each, about 1 s");
  std::set<int> nodes;
  for (int node = 1; node <= nodes_max && socket.is_open(); ++node) {
    static_cast<void>(socket.send(device_type_request(node)));
    collect_nodes(socket, monotonic_now() + from_seconds(0.004), nodes);
  }
  collect_nodes(socket, monotonic_now() + from_seconds(0.5), nodes);
  std::set<int> configured;
  for (const CanopenNodeConfig& node : config.nodes) configured.insert(node.node);
  std::string all;
  std::string unknown;
  for (const int node : nodes) {
    bus.found_numbers.push_back(node);
    all.append(all.empty() ? "" : ", ").append(std::to_string(node));
    if (configured.contains(node)) continue;
    unknown.append(unknown.empty() ? "" : ", ").append(std::to_string(node));
  }
  bus.found = "nodes 1 to 127 searched: " + (all.empty() ? "none is there" : all + " are there");
  if (!unknown.empty()) bus.found += "; not in the configuration: " + unknown;
}

/// What a reading of the protocol is of.
struct Place {
  std::size_t device;
  std::size_t sensor;
  std::string text;
  Why why;
};

struct ProtocolBus {
  std::string name;
  std::string kind;
  std::string interface;
  std::vector<ScanDevice> devices;
  std::vector<Place> places;
};

/// @param afterwards  what else is done with the open bus
ScanBus scan_protocol(ProtocolBus what, CanProtocol& protocol, const ScanSensors& sensors,
                      double listen_s, const std::function<void(const std::string&)>& progress,
                      const std::function<void(CanSocket&, ScanBus&)>& afterwards) {
  ScanBus bus;
  bus.name = what.name;
  bus.kind = what.kind;
  bus.where = what.interface;
  CanSocket socket(what.interface, {});
  socket.also_want({{0, false}, 0});  // everything: what is there beside what is looked for
  socket.also_want({{0, true}, 0});
  Worked worked;
  if (socket.open()) {
    progress("bus " + what.name + ": working it as the daemon would, for " + number_text(listen_s) +
             " s");
    worked = work(protocol, socket, listen_s);
    bus.error = socket.error();
    bus.note = heard_text(worked);
    afterwards(socket, bus);
  } else {
    bus.error = "cannot be opened: " + socket.error();
  }
  const std::vector<std::size_t> order = protocol.sensors();
  for (const Place& place : what.places) {
    const auto at = static_cast<std::size_t>(std::find(order.begin(), order.end(), place.sensor) -
                                             order.begin());
    Reading reading;
    reading.fault = Fault::no_answer;
    RawReading raw;
    if (at < worked.readings.size()) {
      reading = worked.readings[at];
      raw = worked.raw[at];
    }
    ScanChannel shown =
        show(reading, raw, place.why, worked.ended_at, sensors.ranges.at(place.sensor));
    shown.sensor = sensors.names.at(place.sensor);
    shown.place = place.text;
    what.devices[place.device].channels.push_back(std::move(shown));
  }
  for (std::size_t i = 0; i < what.devices.size() && i < worked.units.size(); ++i) {
    what.devices[i].answers = worked.units[i].answering;
    what.devices[i].note = worked.units[i].last_error;
  }
  bus.devices = std::move(what.devices);
  return bus;
}

std::string place_of(const CanopenChannel& channel) {
  if (channel.way == CanopenWay::pdo_bits) {
    return hexadecimal("TPDO ", channel.signal.id, 3) + " bit " +
           std::to_string(channel.signal.start_bit);
  }
  const char* way = channel.way == CanopenWay::sdo ? "SDO " : "TPDO object ";
  return hexadecimal(way, channel.object.index, 4) + " sub " + std::to_string(channel.object.sub);
}

}  // namespace

ScanBus scan_canopen(const CanopenBusConfig& config, const ScanSensors& sensors, double listen_s,
                     bool find_nodes, const std::function<void(const std::string&)>& progress) {
  ProtocolBus bus{config.name, "canopen", config.interface, {}, {}};
  for (const CanopenNodeConfig& node : config.nodes) {
    for (const CanopenChannel& channel : node.channels) {
      bus.places.push_back({bus.devices.size(), channel.sensor, place_of(channel),
                            [&channel](Fault fault, const RawReading& raw) {
                              return why_not(channel, fault, raw);
                            }});
    }
    bus.devices.push_back({node.name, "node " + std::to_string(node.node), false, "", {}});
  }
  CanopenLine line(config);
  return scan_protocol(std::move(bus), line, sensors, listen_s, progress,
                       [&](CanSocket& socket, ScanBus& shown) {
                         if (find_nodes) find_canopen_nodes(config, socket, shown, progress);
                       });
}

ScanBus scan_j1939(const J1939BusConfig& config, const ScanSensors& sensors, double listen_s,
                   const std::function<void(const std::string&)>& progress) {
  ProtocolBus bus{config.name, "j1939", config.interface, {}, {}};
  for (const J1939NodeConfig& node : config.nodes) {
    for (const J1939Channel& channel : node.channels) {
      std::string place = "PGN ";
      place.append(std::to_string(channel.parameter.pgn)).append(" byte ");
      place.append(std::to_string(channel.parameter.start_byte + 1));
      bus.places.push_back({bus.devices.size(), channel.sensor, std::move(place),
                            [&channel](Fault fault, const RawReading& raw) {
                              return why_not(channel.parameter, fault, raw);
                            }});
    }
    const std::string address =
        node.address ? "address " + std::to_string(*node.address) : "by its NAME";
    bus.devices.push_back({node.name, address, false, "", {}});
  }
  J1939Line line(config);
  return scan_protocol(std::move(bus), line, sensors, listen_s, progress,
                       [](CanSocket&, ScanBus&) {});
}

}  // namespace thermocomp::cli
