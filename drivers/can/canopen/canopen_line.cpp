#include "drivers/can/canopen/canopen_line.hpp"

#include <algorithm>
#include <string>

#include "drivers/bus_thread.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

// Predefined connection set of CiA 301: function code in bits 7 to 10, node number below.
constexpr std::uint32_t function_mask = 0x780;
constexpr std::uint32_t node_mask = 0x07F;
constexpr std::uint32_t sync_id = 0x080;
constexpr std::uint32_t emergency_id = 0x080;
constexpr std::uint32_t sdo_answer_id = 0x580;
constexpr std::uint32_t heartbeat_id = 0x700;
constexpr std::uint32_t standard_id_max = 0x7FF;
constexpr int node_max = 127;

CanFrame plain_frame(std::uint32_t id, std::size_t size) {
  CanFrame frame;
  frame.id = {id, false};
  frame.size = size;
  return frame;
}

/// Next due time after `due`; missed periods are skipped.
nanoseconds following(nanoseconds due, nanoseconds period, nanoseconds now) {
  return now - due < period ? due + period : now + period;
}

}  // namespace

CanopenLine::CanopenLine(CanopenBusConfig config) : config_(std::move(config)) {
  std::size_t channels = 0;
  nodes_.reserve(config_.nodes.size());
  for (const CanopenNodeConfig& node : config_.nodes) {
    require(node.node >= 1 && node.node <= node_max, "node", node.node, "must be in [1, 127]");
    require(node.node != config_.own_node, "node", node.node, "is our own (own_node)");
    require(node_of_number_.try_emplace(node.node, nodes_.size()).second, "node", node.node,
            "is used twice on this bus");
    for (const CanopenChannel& channel : node.channels) check(channel.signal);
    for (const CanopenWrite& write : node.writes) {
      require(!write.bytes.empty() && write.bytes.size() <= 4, "type",
              static_cast<double>(write.bytes.size()), "must have 1 to 4 bytes");
    }
    nodes_.emplace_back(node, config_);
    channels += node.channels.size();
  }
  readings_.resize(channels);
}

std::vector<CanFilter> CanopenLine::wanted() const {
  const auto exactly = [](std::uint32_t id) { return CanFilter{{id, false}, standard_id_max}; };
  std::vector<CanFilter> filters;
  for (const CanopenNodeConfig& node : config_.nodes) {
    // The COB-IDs of TPDOs are unknown until they are read from the node.
    if (!node.mappings_read.empty()) return {CanFilter{{0, false}, 0}};
    const auto number = static_cast<std::uint32_t>(node.node);
    filters.push_back(exactly(emergency_id + number));
    filters.push_back(exactly(sdo_answer_id + number));
    filters.push_back(exactly(heartbeat_id + number));
  }
  for (const CanopenNode& node : nodes_) {
    for (const CanopenChannel& channel : node.channels()) {
      if (channel.way != CanopenWay::sdo) filters.push_back(exactly(channel.signal.id));
    }
  }
  return filters;
}

std::vector<std::size_t> CanopenLine::sensors() const {
  std::vector<std::size_t> sensors;
  for (const CanopenNodeConfig& node : config_.nodes) {
    for (const CanopenChannel& channel : node.channels) sensors.push_back(channel.sensor);
  }
  return sensors;
}

void CanopenLine::opened(nanoseconds now) {
  open_ = true;
  sync_at_ = now;
  heartbeat_at_ = now;
  for (CanopenNode& node : nodes_) node.opened(now);
  collect();
}

void CanopenLine::closed(nanoseconds now) {
  open_ = false;
  frames_.clear();
  for (CanopenNode& node : nodes_) node.closed(now);
  collect();
}

void CanopenLine::take(const CanFrame& frame) {
  if (frame.id.extended || !open_) return;
  const nanoseconds at = frame.received_at;
  const auto found = node_of_number_.find(static_cast<int>(frame.id.id & node_mask));
  CanopenNode* node = found == node_of_number_.end() ? nullptr : &nodes_[found->second];
  const std::uint32_t function = frame.id.id & function_mask;
  if (function == emergency_id) {
    if (node != nullptr) node->take_emergency(frame.payload(), at);
  } else if (function == sdo_answer_id) {
    if (node != nullptr) node->take_sdo(frame.payload(), at);
  } else if (function == heartbeat_id) {
    if (node != nullptr) node->take_heartbeat(frame.payload(), at);
  } else {
    for (CanopenNode& each : nodes_) each.take_pdo(frame.id.id, frame.payload(), at);
  }
  collect();
}

void CanopenLine::advance(nanoseconds now) {
  if (!open_) return;
  for (CanopenNode& node : nodes_) node.advance(now);
  look_for_conflicts(now);
  send_cyclic(now);
  collect();
}

void CanopenLine::send_cyclic(nanoseconds now) {
  if (config_.sync_s > 0.0 && now >= sync_at_) {
    sync_at_ = following(sync_at_, from_seconds(config_.sync_s), now);
    frames_.push_back(plain_frame(sync_id, 0));
  }
  if (config_.own_node != 0 && now >= heartbeat_at_) {
    heartbeat_at_ = following(heartbeat_at_, from_seconds(config_.heartbeat_s), now);
    CanFrame frame = plain_frame(heartbeat_id + static_cast<std::uint32_t>(config_.own_node), 1);
    frame.data[0] = state_operational;
    frames_.push_back(frame);
  }
}

/// Detects two nodes that report the same TPDO as their own, so that its values are ambiguous.
void CanopenLine::look_for_conflicts(nanoseconds now) {
  std::map<std::uint32_t, std::vector<std::size_t>> owners;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    for (const std::uint32_t cob_id : nodes_[i].cob_ids_reported()) owners[cob_id].push_back(i);
  }
  std::vector<std::string> reasons(nodes_.size());
  for (const auto& [cob_id, claimed_by] : owners) {
    if (claimed_by.size() < 2) continue;
    for (const std::size_t i : claimed_by) {
      const std::size_t other = claimed_by[0] == i ? claimed_by[1] : claimed_by[0];
      reasons[i] = "COB-ID " + to_string(CanId{cob_id, false}) + " is sent by node " +
                   std::to_string(config_.nodes[other].node) + " (" + config_.nodes[other].name +
                   ") too";
    }
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].claim_conflict(reasons[i], now);
}

std::optional<CanFrame> CanopenLine::next_frame() {
  if (!frames_.empty()) {
    const CanFrame frame = frames_.front();
    frames_.pop_front();
    return frame;
  }
  for (CanopenNode& node : nodes_) {
    if (auto frame = node.next_frame()) return frame;
  }
  return std::nullopt;
}

void CanopenLine::collect() {
  auto out = readings_.begin();
  for (const CanopenNode& node : nodes_) {
    out = std::copy(node.readings().begin(), node.readings().end(), out);
  }
}

std::vector<RawReading> CanopenLine::raw() const {
  std::vector<RawReading> all;
  for (const CanopenNode& node : nodes_) {
    all.insert(all.end(), node.raw().begin(), node.raw().end());
  }
  return all;
}

std::vector<UnitHealth> CanopenLine::health(nanoseconds now) const {
  std::vector<UnitHealth> units;
  units.reserve(nodes_.size());
  for (const CanopenNode& node : nodes_) units.push_back(node.health(now));
  return units;
}

}  // namespace thermocomp
