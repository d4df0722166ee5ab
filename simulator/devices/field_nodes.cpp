#include "simulator/devices/field_nodes.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

namespace thermocomp {
namespace {

constexpr nanoseconds open_again_after = std::chrono::milliseconds(200);

template <class Channel>
std::vector<std::size_t> find_columns(const std::vector<Channel>& channels, const std::string& user,
                                      const std::vector<std::string>& columns,
                                      const std::string& source) {
  std::vector<std::size_t> found;
  for (const Channel& channel : channels) {
    const auto place = std::find(columns.begin(), columns.end(), channel.column);
    if (place == columns.end()) {
      std::string text = source;
      text.append(": has no column ").append(channel.column).append(", which ");
      text.append(user).append(" shows");
      throw std::runtime_error(text);
    }
    found.push_back(static_cast<std::size_t>(place - columns.begin()));
  }
  return found;
}

}  // namespace

/// A node with its socket and the columns of its values.
struct FieldNodes::Node {
  Node(SimulatedNode simulated, std::string node_name, std::string on,
       std::vector<std::size_t> shown)
      : config(std::move(simulated)),
        name(std::move(node_name)),
        interface(std::move(on)),
        columns(std::move(shown)),
        temps_degC(columns.size()),
        socket(interface, {}) {
    for (const bool extended : {false, true}) socket.add_filter({{0, extended}, 0});
    socket.open();
  }

  void take(const CanFrame& frame, nanoseconds now) {
    if (node) node->take(frame, now);
  }
  void update(nanoseconds now, std::span<const double> row) {
    for (std::size_t i = 0; i < columns.size(); ++i) temps_degC[i] = row[columns[i]];
    if (node) node->update(now, temps_degC);
  }
  std::optional<CanFrame> next_frame() { return node ? node->next_frame() : std::nullopt; }

  SimulatedNode config;
  std::string name;
  std::string interface;
  std::vector<std::size_t> columns;
  std::vector<double> temps_degC;
  CanSocket socket;
  bool measured{false};
  nanoseconds tried_at{};
  std::unique_ptr<FieldNode> node;  ///< nullptr: not powered up
};

FieldNodes::FieldNodes(const MachineConfig& config, const std::vector<std::string>& columns,
                       const std::string& source) {
  const auto add = [&](const auto& node) {
    const auto shown = find_columns(node.channels, node.name, columns, source);
    nodes_.push_back(std::make_unique<Node>(node, node.name, node.interface, shown));
  };
  for (const SimulatedNode& node : config.field_nodes) std::visit(add, node);
}

FieldNodes::~FieldNodes() = default;

void FieldNodes::switch_on(nanoseconds now) {
  for (const auto& node : nodes_)
    node->node = std::visit([now](const auto& each) { return thermocomp::switch_on(each, now); },
                            node->config);
}

std::vector<FieldNodes::Place> FieldNodes::places() const {
  std::vector<Place> places;
  for (const auto& node : nodes_) {
    places.push_back(
        {node->name, node->interface, node->socket.is_open() ? "" : node->socket.error()});
  }
  return places;
}

void FieldNodes::update(nanoseconds now, std::span<const double> row) {
  for (const auto& node : nodes_) {
    if (!node->socket.is_open() && now >= node->tried_at + open_again_after) {
      node->tried_at = now;
      node->socket.open();
    }
    // A node has no values before its first update.
    if (!std::exchange(node->measured, true)) node->update(now, row);
    while (node->socket.is_open()) {
      const auto frames = node->socket.receive();
      for (const CanFrame& frame : frames) node->take(frame, now);
      if (frames.size() < CanSocket::batch_max) break;
    }
    node->update(now, row);
    while (const auto frame = node->next_frame()) node->socket.send(*frame);
  }
}

}  // namespace thermocomp
