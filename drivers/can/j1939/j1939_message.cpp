#include "drivers/can/j1939/j1939_message.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr int length_max = 32;
constexpr std::uint64_t highest_value = 0xFA;
constexpr std::uint64_t error_byte = 0xFE;
constexpr std::uint64_t not_available_byte = 0xFF;

std::size_t bytes_needed(const J1939Parameter& parameter) noexcept {
  const int bytes = parameter.start_byte + (parameter.start_bit + parameter.length_bits + 7) / 8;
  return static_cast<std::size_t>(bytes);
}

/// Fault::none if the raw value is no indicator.
Fault indicated(std::uint64_t raw, const J1939Parameter& parameter) noexcept {
  const int bits = parameter.length_bits;
  if (bits % 8 == 0) {
    const std::uint64_t top = raw >> (bits - 8);
    if (top == not_available_byte) return parameter.not_available;
    if (top == error_byte) return parameter.error;
    return top > highest_value ? Fault::out_of_range : Fault::none;
  }
  const std::uint64_t ones = (std::uint64_t{1} << bits) - 1;
  if (raw == ones) return parameter.not_available;
  return raw == ones - 1 ? parameter.error : Fault::none;
}

}  // namespace

J1939Id read_identifier(std::uint32_t id) noexcept {
  J1939Id read;
  read.source = static_cast<std::uint8_t>(id);
  read.priority = static_cast<int>((id >> 26) & 7u);
  read.pgn = (id >> 8) & pgn_max;
  if (is_addressed(read.pgn)) {
    read.destination = static_cast<std::uint8_t>(read.pgn);
    read.pgn &= ~0xFFu;
  }
  return read;
}

CanId identifier(const J1939Id& id) noexcept {
  const std::uint32_t specific = is_addressed(id.pgn) ? id.destination : 0u;
  return {(static_cast<std::uint32_t>(id.priority) << 26) | ((id.pgn | specific) << 8) | id.source,
          true};
}

void check(const J1939Parameter& parameter) {
  require(parameter.pgn <= pgn_max, "pgn", parameter.pgn, "must be in [0, 262143]");
  require(!is_addressed(parameter.pgn) || (parameter.pgn & 0xFFu) == 0, "pgn", parameter.pgn,
          "a group that is sent to one node has 0 in its lowest byte");
  require(parameter.length_bits >= 2 && parameter.length_bits <= length_max, "length_bits",
          parameter.length_bits, "must be in [2, 32]");
  require(parameter.start_bit >= 0 && parameter.start_bit < 8, "start_bit", parameter.start_bit,
          "must be a bit of the byte");
  require(parameter.start_byte >= 0 && bytes_needed(parameter) <= j1939_bytes_max, "start_byte",
          parameter.start_byte, "the parameter must end within 1785 bytes");
  require(std::isfinite(parameter.scale) && parameter.scale != 0.0, "scale", parameter.scale,
          "must be finite and not 0");
  require(std::isfinite(parameter.offset), "offset", parameter.offset, "must be finite");
  require(parameter.error != Fault::none && parameter.not_available != Fault::none, "error_means",
          0.0, "must be a fault");
}

std::uint64_t extract_raw(std::span<const std::uint8_t> message,
                          const J1939Parameter& parameter) noexcept {
  const auto first = static_cast<std::size_t>(parameter.start_byte);
  const std::uint64_t bytes = little_endian(message, first, 8);
  const std::uint64_t mask = (std::uint64_t{1} << parameter.length_bits) - 1;
  return (bytes >> parameter.start_bit) & mask;
}

CanValue decode(std::span<const std::uint8_t> message, const J1939Parameter& parameter) noexcept {
  if (message.size() < bytes_needed(parameter)) return {};
  const std::uint64_t raw = extract_raw(message, parameter);
  for (const Sentinel& sentinel : parameter.sentinels) {
    if (sentinel.code == static_cast<std::int64_t>(raw)) return {not_a_number, sentinel.fault};
  }
  if (const Fault fault = indicated(raw, parameter); fault != Fault::none) {
    return {not_a_number, fault};
  }
  const double value = static_cast<double>(raw) * parameter.scale + parameter.offset;
  if (!std::isfinite(value)) return {not_a_number, Fault::out_of_range};
  return {value, Fault::none};
}

namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t request_to_send = 16;
constexpr std::uint8_t clear_to_send = 17;
constexpr std::uint8_t end_of_message = 19;
constexpr std::uint8_t broadcast_announce = 32;
constexpr std::uint8_t connection_abort = 255;

constexpr std::uint8_t reason_no_resources = 2;
constexpr std::uint8_t reason_timeout = 3;
constexpr std::uint8_t reason_bad_sequence = 7;
constexpr std::uint8_t reason_bad_size = 9;

constexpr std::size_t frame_bytes = 8;
constexpr std::size_t packet_bytes = 7;
constexpr std::size_t size_min = 9;
constexpr int granted_max = 16;                   // packets per CTS
constexpr nanoseconds packet_gap_max = 750ms;     // T1: between two packets
constexpr nanoseconds first_packet_max = 1250ms;  // T2: after a CTS

}  // namespace

TransportReceiver::TransportReceiver(std::vector<std::uint32_t> wanted)
    : wanted_(std::move(wanted)) {
  std::sort(wanted_.begin(), wanted_.end());
}

bool TransportReceiver::is_wanted(std::uint32_t pgn) const {
  return std::binary_search(wanted_.begin(), wanted_.end(), pgn);
}

void TransportReceiver::set_address(std::optional<std::uint8_t> address) {
  if (address_ != address) forget();
  address_ = address;
}

void TransportReceiver::forget() {
  transfers_.clear();
  frames_.clear();
}

std::optional<J1939Message> TransportReceiver::take(const J1939Id& id,
                                                    std::span<const std::uint8_t> data,
                                                    nanoseconds at) {
  const bool to_us = address_ && id.destination == *address_;
  if (data.size() != frame_bytes || (id.destination != address_global && !to_us)) {
    return std::nullopt;
  }
  if (id.pgn == pgn_transfer_data) return take_packet(id, data, at);
  const std::uint8_t kind = data[0];
  const bool broadcast = id.destination == address_global;
  if (kind == (broadcast ? broadcast_announce : request_to_send)) {
    begin(id, data, at);
  } else if (kind == connection_abort && !broadcast) {
    const auto found = transfers_.find({id.source, false});
    if (found != transfers_.end() && found->second.pgn == little_endian(data, 5, 3)) {
      transfers_.erase(found);
      ++failed_;
    }
  }
  return std::nullopt;
}

void TransportReceiver::begin(const J1939Id& id, std::span<const std::uint8_t> data,
                              nanoseconds at) {
  const bool broadcast = id.destination == address_global;
  const Key key{id.source, broadcast};
  // A new announcement ends the sender's earlier transfer.
  if (transfers_.erase(key) != 0) ++failed_;
  Transfer transfer;
  transfer.pgn = static_cast<std::uint32_t>(little_endian(data, 5, 3));
  transfer.size = static_cast<std::size_t>(little_endian(data, 1, 2));
  transfer.packets = data[3];
  const std::size_t packets = (transfer.size + packet_bytes - 1) / packet_bytes;
  if (!is_wanted(transfer.pgn)) {
    if (!broadcast) abort(id.source, reason_no_resources, transfer.pgn);
    return;
  }
  if (transfer.size < size_min || transfer.size > static_cast<std::size_t>(j1939_bytes_max) ||
      packets != static_cast<std::size_t>(transfer.packets)) {
    ++failed_;
    if (!broadcast) abort(id.source, reason_bad_size, transfer.pgn);
    return;
  }
  transfer.bytes.reserve(packets * packet_bytes);
  transfer.deadline = at + packet_gap_max;
  transfer.granted_at_once = std::clamp<int>(data[4], 1, granted_max);
  Transfer& begun = transfers_[key] = std::move(transfer);
  if (!broadcast) grant(id.source, begun, at);
}

void TransportReceiver::grant(std::uint8_t source, Transfer& transfer, nanoseconds at) {
  const int count = std::min(transfer.granted_at_once, transfer.packets - transfer.next + 1);
  transfer.granted = transfer.next + count - 1;
  transfer.deadline = at + first_packet_max;
  const auto middle = static_cast<std::uint64_t>(count) |
                      static_cast<std::uint64_t>(transfer.next) << 8 | 0xFFFF0000u;
  control(source, clear_to_send, middle, transfer.pgn);
}

std::optional<J1939Message> TransportReceiver::take_packet(const J1939Id& id,
                                                           std::span<const std::uint8_t> data,
                                                           nanoseconds at) {
  const bool broadcast = id.destination == address_global;
  const auto found = transfers_.find({id.source, broadcast});
  if (found == transfers_.end()) return std::nullopt;
  Transfer& transfer = found->second;
  if (data[0] != transfer.next) {
    if (!broadcast) abort(id.source, reason_bad_sequence, transfer.pgn);
    transfers_.erase(found);
    ++failed_;
    return std::nullopt;
  }
  transfer.bytes.insert(transfer.bytes.end(), data.begin() + 1, data.end());
  transfer.deadline = at + packet_gap_max;
  if (transfer.next++ < transfer.packets) {
    if (!broadcast && transfer.next > transfer.granted) grant(id.source, transfer, at);
    return std::nullopt;
  }
  if (!broadcast) {
    const auto middle = transfer.size | static_cast<std::uint64_t>(transfer.packets) << 16 |
                        std::uint64_t{0xFF} << 24;
    control(id.source, end_of_message, middle, transfer.pgn);
  }
  transfer.bytes.resize(transfer.size);
  J1939Message message{transfer.pgn, id.source, std::move(transfer.bytes), at};
  transfers_.erase(found);
  return message;
}

void TransportReceiver::advance(nanoseconds now) {
  for (auto each = transfers_.begin(); each != transfers_.end();) {
    if (now < each->second.deadline) {
      ++each;
      continue;
    }
    if (!each->first.broadcast) abort(each->first.source, reason_timeout, each->second.pgn);
    ++failed_;
    each = transfers_.erase(each);
  }
}

/// @param middle  bytes 2 to 5 of the message, lowest first
void TransportReceiver::control(std::uint8_t to, std::uint8_t kind, std::uint64_t middle,
                                std::uint32_t pgn) {
  if (!address_) return;
  CanFrame frame;
  frame.id = identifier({pgn_transfer, *address_, to, 7});
  frame.size = frame_bytes;
  frame.data[0] = kind;
  put_little_endian(frame.data, 1, 4, middle);
  put_little_endian(frame.data, 5, 3, pgn);
  frames_.push_back(frame);
}

void TransportReceiver::abort(std::uint8_t to, std::uint8_t reason, std::uint32_t pgn) {
  control(to, connection_abort, std::uint64_t{reason} | 0xFFFFFF00u, pgn);
}

std::optional<CanFrame> TransportReceiver::next_frame() {
  if (frames_.empty()) return std::nullopt;
  const CanFrame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

}  // namespace thermocomp
