// Scan of a CANopen bus: sets up, starts and polls its nodes as configured.
#include <optional>
#include <poll.h>
#include <set>

#include "cli/scan/scan_protocol.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp::cli {
namespace {

/// Reason why the bytes are not a value: the device's code or status, else the node's own report.
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
      return "its status is " + hexadecimal(static_cast<std::uint32_t>(number), 2);
    }
  }
  return "the bytes would be a value, but the node is in trouble, see above";
}

constexpr int nodes_max = 127;

/// SDO upload request for object 1000, which every node has.
CanFrame device_type_request(int node) {
  constexpr std::uint32_t request_base = 0x600;
  CanFrame frame;
  frame.id = {request_base + static_cast<std::uint32_t>(node), false};
  frame.size = 8;
  frame.data[0] = 0x40;
  frame.data[2] = 0x10;
  return frame;
}

constexpr std::uint32_t heartbeat_base = 0x700;

/// Collects nodes that answer or send heartbeats until `end`.
void collect_nodes(CanSocket& socket, nanoseconds end, std::set<int>& nodes) {
  constexpr std::uint32_t answer_base = 0x580;
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
  bus.found = "nodes 1 to 127 searched: " + (all.empty() ? "none found" : all + " found");
  if (!unknown.empty()) bus.found += "; not in the configuration: " + unknown;
}

/// Nodes with heartbeats that the configuration lacks.
std::string strangers_text(const CanopenBusConfig& config, const FrameCounts& frames) {
  std::string text;
  for (const auto& [id, count] : frames) {
    const auto node = static_cast<int>(id.id) - static_cast<int>(heartbeat_base);
    const bool is_configured =
        std::any_of(config.nodes.begin(), config.nodes.end(),
                    [&](const CanopenNodeConfig& each) { return each.node == node; });
    if (id.extended || node < 1 || node > nodes_max || is_configured) continue;
    text.append(text.empty() ? "; not in the configuration, but there by its heartbeats: node "
                             : ", node ");
    text.append(std::to_string(node));
  }
  return text;
}

std::string place_of(const CanopenChannel& channel) {
  if (channel.way == CanopenWay::pdo_bits) {
    return "TPDO " + hexadecimal(channel.signal.id, 3) + " bit " +
           std::to_string(channel.signal.start_bit);
  }
  const char* way = channel.way == CanopenWay::sdo ? "SDO " : "TPDO object ";
  return way + hexadecimal(channel.object.index, 4) + " sub " + std::to_string(channel.object.sub);
}

}  // namespace

ScanBus scan_bus(const CanopenBusConfig& config, const ScanSensors& sensors, const ScanTask& task) {
  ProtocolBus bus{config.name, config.outline(), {}, {}};
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
  return scan_protocol(std::move(bus), line, sensors, task,
                       [&](CanSocket& socket, const FrameCounts& frames, ScanBus& shown) {
                         shown.note += strangers_text(config, frames);
                         if (task.search.wanted)
                           find_canopen_nodes(config, socket, shown, task.progress);
                       });
}

}  // namespace thermocomp::cli
