#include "drivers/can/j1939/j1939_line.hpp"

#include <algorithm>
#include <cstdio>

#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using namespace std::chrono_literals;

constexpr nanoseconds silent_after = 5s;
constexpr nanoseconds rivals_gone_after = 30s;
constexpr std::size_t name_bytes = 8;
constexpr std::size_t request_bytes = 3;
constexpr std::uint32_t any_specific = 0x03FF0000;  // mask for the group only, of an addressed one
constexpr std::uint32_t any_source = 0x03FFFF00;

std::vector<std::uint32_t> groups(const J1939BusConfig& config) {
  std::vector<std::uint32_t> pgns;
  for (const J1939NodeConfig& node : config.nodes) {
    for (const J1939Channel& channel : node.channels) pgns.push_back(channel.parameter.pgn);
  }
  return pgns;
}

std::string name_text(std::uint64_t name) {
  return hexadecimal(name, 16);
}

std::string address_text(std::uint8_t address) {
  return "address " + hexadecimal(address, 2);
}

/// All bytes of a single-frame group; of a longer one the bytes of the parameter.
std::span<const std::uint8_t> bytes_of(std::span<const std::uint8_t> group,
                                       const J1939Parameter& parameter) {
  constexpr std::size_t one_frame_bytes = 8;
  const auto first = static_cast<std::size_t>(parameter.start_byte);
  if (group.size() <= one_frame_bytes || first >= group.size()) return group;
  const int bytes = (parameter.start_bit + parameter.length_bits + 7) / 8;
  return group.subspan(first, std::min(group.size() - first, static_cast<std::size_t>(bytes)));
}

/// The group from any sender.
CanFilter filter_of(std::uint32_t pgn) {
  return {identifier({pgn, 0, 0, 0}), is_addressed(pgn) ? any_specific : any_source};
}

}  // namespace

J1939Line::J1939Line(J1939BusConfig config)
    : config_(std::move(config)), transport_(groups(config_)) {
  for (const J1939NodeConfig& node : config_.nodes) {
    require(node.address || node.name_claimed, "address", 0.0, "or j1939_name must be given");
    const int address = node.address.value_or(0);
    require(address >= 0 && address <= address_max, "address", address, "must be in [0, 253]");
    Node& made = nodes_.emplace_back();
    made.first = readings_.size();
    made.counters.name = node.name;
    for (const J1939Channel& channel : node.channels) check(channel.parameter);
    readings_.resize(readings_.size() + node.channels.size());
    raw_.resize(readings_.size());
  }
  const int own = config_.own_address.value_or(0);
  require(own >= 0 && own <= address_max, "own_address", own, "must be in [0, 253]");
}

std::vector<CanFilter> J1939Line::wanted() const {
  std::vector<CanFilter> filters;
  for (const std::uint32_t pgn :
       {pgn_transfer, pgn_transfer_data, pgn_address_claimed, pgn_request}) {
    filters.push_back(filter_of(pgn));
  }
  for (const J1939NodeConfig& node : config_.nodes) {
    for (const J1939Channel& channel : node.channels) {
      CanFilter& filter = filters.emplace_back(filter_of(channel.parameter.pgn));
      if (node.name_claimed || !node.address) continue;  // its address may change
      filter.id.id |= static_cast<std::uint32_t>(*node.address);
      filter.mask |= 0xFFu;
    }
  }
  const auto key = [](const CanFilter& each) { return std::pair(each.id.id, each.mask); };
  std::sort(filters.begin(), filters.end(),
            [&](const auto& a, const auto& b) { return key(a) < key(b); });
  filters.erase(std::unique(filters.begin(), filters.end(),
                            [&](const auto& a, const auto& b) { return key(a) == key(b); }),
                filters.end());
  return filters;
}

std::vector<std::size_t> J1939Line::sensors() const {
  std::vector<std::size_t> sensors;
  for (const J1939NodeConfig& node : config_.nodes) {
    for (const J1939Channel& channel : node.channels) sensors.push_back(channel.sensor);
  }
  return sensors;
}

std::optional<std::uint8_t> J1939Line::address_of(std::size_t node) const {
  return nodes_.at(node).address;
}

void J1939Line::opened(nanoseconds now) {
  open_ = true;
  claims_.fill(std::nullopt);
  own_error_.clear();
  own_address_.reset();
  if (config_.own_address) own_address_ = static_cast<std::uint8_t>(*config_.own_address);
  transport_.forget();
  transport_.set_address(own_address_);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const J1939NodeConfig& config = config_.nodes[i];
    nodes_[i].address.reset();
    if (config.address) nodes_[i].address = static_cast<std::uint8_t>(*config.address);
    nodes_[i].note.clear();
    nodes_[i].rivals.reset();
    if (!config.address) nodes_[i].note = "no device has claimed an address with its NAME yet";
    lose(i, now);
  }
  if (own_address_) claim(*own_address_);
  ask_for_names();  // two answers from one address show two devices
}

void J1939Line::closed(nanoseconds now) {
  open_ = false;
  transport_.forget();
  frames_.clear();
  for (std::size_t i = 0; i < nodes_.size(); ++i) lose(i, now);
}

void J1939Line::lose(std::size_t node, nanoseconds at, Fault fault) {
  for (std::size_t i = 0; i < config_.nodes[node].channels.size(); ++i) {
    readings_[nodes_[node].first + i] = {not_a_number, at, fault};
    raw_[nodes_[node].first + i] = {};
  }
}

// -------------------------------------------------------------------- addresses

void J1939Line::claim(std::uint8_t from) {
  CanFrame frame;
  frame.id = identifier({pgn_address_claimed, from, address_global, 6});
  frame.size = name_bytes;
  put_little_endian(frame.data, 0, name_bytes, config_.own_name);
  frames_.push_back(frame);
}

/// Permitted even for a node without address.
void J1939Line::ask_for_names() {
  CanFrame frame;
  frame.id = identifier({pgn_request, own_address_.value_or(address_null), address_global, 6});
  frame.size = request_bytes;
  put_little_endian(frame.data, 0, request_bytes, pgn_address_claimed);
  frames_.push_back(frame);
}

/// Handles another node's claim of our address: the smaller NAME wins.
void J1939Line::take_claim_of_ours(std::uint64_t name) {
  if (name >= config_.own_name) {
    claim(*own_address_);
    return;
  }
  own_error_ = "our " + address_text(*own_address_) + " was claimed by " + name_text(name);
  own_address_.reset();
  transport_.set_address(std::nullopt);
  claim(address_null);
}

void J1939Line::take_claim(std::uint8_t source, std::span<const std::uint8_t> data,
                           nanoseconds at) {
  if (data.size() != name_bytes) return;
  const std::uint64_t name = little_endian(data, 0, name_bytes);
  if (own_address_ && source == *own_address_) take_claim_of_ours(name);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    move_node(i, source, name, at);
    note_rivals(i, source, name, at);
  }
  for (std::optional<Claim>& each : claims_)
    if (each && each->name == name) each->at = {};  // it has left that address
  claims_[source] = {name, at};
}

void J1939Line::note_rivals(std::size_t index, std::uint8_t source, std::uint64_t name,
                            nanoseconds at) {
  Node& node = nodes_[index];
  if (node.rivals && node.rivals->address != source &&
      (node.rivals->names[0] == name || node.rivals->names[1] == name)) {
    node.rivals.reset();
    node.note.clear();
  }
  const std::optional<Claim>& last = claims_[source];
  if (node.address != source || !last || last->name == name || at - last->at > silent_after) return;
  node.rivals = {source, {last->name, name}, at};
  node.note = address_text(source) + " is claimed by " + name_text(last->name) + " and " +
              name_text(name) + ": two devices send from it, give one of them another address";
  lose(index, at, Fault::device_error);
}

void J1939Line::move_node(std::size_t index, std::uint8_t source, std::uint64_t name,
                          nanoseconds at) {
  Node& node = nodes_[index];
  const std::optional<std::uint64_t>& expected = config_.nodes[index].name_claimed;
  const bool at_its_place = node.address && *node.address == source;
  if (!expected) {
    if (at_its_place && claims_[source] && claims_[source]->name != name) {
      node.note = address_text(source) + ": NAME changed from " + name_text(claims_[source]->name) +
                  " to " + name_text(name);
    }
    return;
  }
  if (name == *expected) {
    if (at_its_place) {
      node.note.clear();
    } else if (source <= address_max) {
      node.address = source;
      node.note.clear();
      lose(index, at);
    } else {
      node.address.reset();
      node.note = "could not claim an address";
      lose(index, at);
    }
  } else if (at_its_place) {
    node.address.reset();
    node.note = address_text(source) + " was claimed by " + name_text(name);
    lose(index, at);
  }
}

// -------------------------------------------------------------------- frames

void J1939Line::take(const CanFrame& frame) {
  if (!frame.id.extended || !open_) return;
  const J1939Id id = read_identifier(frame.id.id);
  const nanoseconds at = frame.received_at;
  switch (id.pgn) {
    case pgn_transfer:
    case pgn_transfer_data:
      if (const auto message = transport_.take(id, frame.payload(), at)) {
        take_group(message->pgn, message->source, message->bytes, message->received_at);
      }
      break;
    case pgn_address_claimed:
      take_claim(id.source, frame.payload(), at);
      break;
    case pgn_request: {
      const bool for_us =
          id.destination == address_global || (own_address_ && id.destination == *own_address_);
      if (own_address_ && for_us && frame.size >= request_bytes &&
          little_endian(frame.payload(), 0, request_bytes) == pgn_address_claimed) {
        claim(*own_address_);
      }
      break;
    }
    default:
      take_group(id.pgn, id.source, frame.payload(), at);
      break;
  }
}

void J1939Line::take_group(std::uint32_t pgn, std::uint8_t source,
                           std::span<const std::uint8_t> bytes, nanoseconds at) {
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    Node& node = nodes_[n];
    if (!node.address || *node.address != source) continue;
    if (node.rivals && at - node.rivals->heard_at > rivals_gone_after) {
      node.rivals.reset();
      node.note.clear();
    }
    const auto& channels = config_.nodes[n].channels;
    bool has_channel = false;
    bool is_short = false;
    for (std::size_t i = 0; i < channels.size(); ++i) {
      if (channels[i].parameter.pgn != pgn) continue;
      const CanValue decoded = node.rivals ? CanValue{not_a_number, Fault::device_error}
                                           : decode(bytes, channels[i].parameter);
      readings_[node.first + i] = {decoded.value, at, decoded.fault};
      const auto shown = bytes_of(bytes, channels[i].parameter);
      raw_[node.first + i].value.assign(shown.begin(), shown.end());
      has_channel = true;
      is_short = is_short || decoded.fault == Fault::bad_frame;
    }
    if (!has_channel) continue;
    if (node.rivals) node.rivals->heard_at = at;
    if (is_short) {
      ++node.counters.bad_frames;
      node.counters.last_error = "message too short";
    } else {
      ++node.counters.answers;
      node.counters.last_error.clear();
      node.good_at = at;
    }
  }
}

void J1939Line::advance(nanoseconds now) {
  if (open_) transport_.advance(now);
}

std::optional<CanFrame> J1939Line::next_frame() {
  if (frames_.empty()) return transport_.next_frame();
  const CanFrame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

std::vector<UnitHealth> J1939Line::health(nanoseconds now) const {
  std::vector<UnitHealth> units;
  for (const Node& node : nodes_) {
    UnitHealth& unit = units.emplace_back(node.counters);
    unit.answering = open_ && node.good_at != nanoseconds{0} && now - node.good_at < silent_after;
    if (unit.last_error.empty()) unit.last_error = node.note.empty() ? own_error_ : node.note;
  }
  return units;
}

}  // namespace thermocomp
