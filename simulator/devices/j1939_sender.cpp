#include "simulator/devices/j1939_sender.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/bus_thread.hpp"
#include "drivers/can/j1939/j1939_message.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp {
namespace {

// Limits of the highest byte, or of a single byte.
constexpr std::uint64_t greatest = 0xFA;
constexpr std::uint64_t beyond = 0xFB;
constexpr std::uint64_t error_code = 0xFE;
constexpr std::uint64_t not_available = 0xFF;
constexpr std::size_t frame_bytes = 8;
constexpr std::size_t packet_bytes = 7;
constexpr std::uint8_t broadcast_announce = 32;

}  // namespace

J1939Sender::J1939Sender(const SimulatedJ1939Node& config, nanoseconds now)
    : config_(config), switched_on_(now), groups_at_(now) {
  for (const J1939NodeChannel& channel : config_.channels) {
    std::vector<std::uint8_t>& group = groups_[channel.place.pgn];
    const auto bytes = static_cast<std::size_t>(channel.place.length_bits / 8);
    const std::size_t end = static_cast<std::size_t>(channel.place.start_byte) + bytes;
    group.resize(std::max({group.size(), end, frame_bytes}), 0xFF);  // "not available"
  }
  claim();
}

bool J1939Sender::happens(NodeEventKind kind, nanoseconds now) const {
  return std::any_of(config_.events.begin(), config_.events.end(), [&](const NodeEvent& event) {
    return event.kind == kind && is_now(event, now);
  });
}

bool J1939Sender::is_now(const NodeEvent& event, nanoseconds now) const {
  const double time_s = std::chrono::duration<double>(now - switched_on_).count();
  return time_s >= event.at_s && time_s < event.at_s + event.duration_s;
}

/// Code sent instead of the value: the event's, else the first listed, else the standard's.
std::optional<std::uint64_t> J1939Sender::code_of(std::size_t channel, nanoseconds now) const {
  const auto event =
      std::find_if(config_.events.begin(), config_.events.end(), [&](const NodeEvent& each) {
        return channel_fault(each.kind) && each.channel == channel && is_now(each, now);
      });
  if (event == config_.events.end()) return std::nullopt;
  if (event->code) return static_cast<std::uint64_t>(*event->code);
  const J1939NodeChannel& from = config_.channels[channel];
  const auto listed = code_for(from.codes, channel_fault(event->kind), std::nullopt);
  if (listed) return static_cast<std::uint64_t>(*listed);
  const int shift = from.place.length_bits - 8;
  if (event->kind == NodeEventKind::over_range) return beyond << shift;
  if (event->kind == NodeEventKind::channel_error) return not_available << shift;
  return error_code << shift;
}

void J1939Sender::put(std::uint32_t pgn, std::span<const std::uint8_t> data) {
  CanFrame frame;
  frame.id = identifier({pgn, static_cast<std::uint8_t>(config_.address), address_global, 6});
  frame.size = data.size();
  std::copy(data.begin(), data.end(), frame.data.begin());
  frames_.push_back(frame);
}

void J1939Sender::claim() {
  std::vector<std::uint8_t> name(frame_bytes);
  put_little_endian(name, 0, frame_bytes, config_.name_claimed);
  put(pgn_address_claimed, name);
}

void J1939Sender::take(const CanFrame& frame, nanoseconds /*now*/) {
  if (!frame.id.extended) return;
  const J1939Id id = read_identifier(frame.id.id);
  const bool for_us = id.destination == address_global || id.destination == config_.address;
  if (id.pgn == pgn_request && for_us && frame.size >= 3 &&
      little_endian(frame.payload(), 0, 3) == pgn_address_claimed) {
    claim();
  }
}

void J1939Sender::send_group(std::uint32_t pgn, std::span<const std::uint8_t> bytes) {
  if (bytes.size() <= frame_bytes) return put(pgn, bytes);
  const std::size_t packets = (bytes.size() + packet_bytes - 1) / packet_bytes;
  std::vector<std::uint8_t> data(frame_bytes, 0xFF);
  data[0] = broadcast_announce;
  put_little_endian(data, 1, 2, bytes.size());
  data[3] = static_cast<std::uint8_t>(packets);
  put_little_endian(data, 5, 3, pgn);
  put(pgn_transfer, data);
  for (std::size_t i = 0; i < packets; ++i) {
    std::fill(data.begin(), data.end(), std::uint8_t{0xFF});
    data[0] = static_cast<std::uint8_t>(i + 1);
    const auto part = bytes.subspan(packet_bytes * i);
    std::copy_n(part.begin(), std::min(packet_bytes, part.size()), data.begin() + 1);
    put(pgn_transfer_data, data);
  }
}

void J1939Sender::update(nanoseconds now, std::span<const double> temps_degC) {
  if (happens(NodeEventKind::silence, now)) {
    frames_.clear();
    return;
  }
  if (now < groups_at_) return;
  const nanoseconds period = from_seconds(config_.period_s);
  groups_at_ = now - groups_at_ < period ? groups_at_ + period : now + period;
  for (std::size_t i = 0; i < config_.channels.size(); ++i) {
    const J1939Parameter& place = config_.channels[i].place;
    const double highest = std::ldexp(static_cast<double>(greatest + 1), place.length_bits - 8) - 1;
    const double counts = std::round((temps_degC[i] - place.offset) / place.scale);
    const auto value = std::isnan(counts)
                           ? error_code << (place.length_bits - 8)
                           : static_cast<std::uint64_t>(std::clamp(counts, 0.0, highest));
    put_little_endian(groups_.at(place.pgn), static_cast<std::size_t>(place.start_byte),
                      static_cast<std::size_t>(place.length_bits / 8),
                      code_of(i, now).value_or(value));
  }
  for (const auto& [pgn, bytes] : groups_) send_group(pgn, bytes);
}

std::optional<CanFrame> J1939Sender::next_frame() {
  if (frames_.empty()) return std::nullopt;
  const CanFrame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

std::unique_ptr<FieldNode> switch_on(const SimulatedJ1939Node& node, nanoseconds now) {
  return std::make_unique<J1939Sender>(node, now);
}

}  // namespace thermocomp
