#include "drivers/modbus/modbus_codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace thermocomp {
namespace {

constexpr std::size_t head_bytes = 7;  // TCP: transaction id, protocol, length, unit
constexpr std::size_t checksum_bytes = 2;
constexpr std::uint8_t write_single_register = 6;

constexpr std::uint8_t high_byte(std::size_t word) noexcept {
  return static_cast<std::uint8_t>((word >> 8) & 0xFF);
}
constexpr std::uint8_t low_byte(std::size_t word) noexcept {
  return static_cast<std::uint8_t>(word & 0xFF);
}

/// "MODBUS over serial line specification and implementation guide V1.02", 6.2.2.
constexpr std::uint16_t checksum(std::span<const std::uint8_t> bytes) noexcept {
  unsigned sum = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit) sum = (sum & 1) != 0 ? (sum >> 1) ^ 0xA001 : sum >> 1;
  }
  return static_cast<std::uint16_t>(sum);
}

/// Length of the answer that begins here; 0: unknown.
constexpr std::size_t rtu_answer_bytes(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() < 4) return 0;
  const std::uint8_t function = bytes[1];
  if ((function & exception_bit) != 0) return 5;
  if (function >= 1 && function <= 4) return std::size_t{5} + bytes[2];
  const bool confirms = function == 5 || function == 6 || function == 15 || function == 16;
  return confirms ? 8 : 0;
}

/// The complete answer that begins here, with correct checksum; else empty.
std::span<const std::uint8_t> rtu_answer(std::span<const std::uint8_t> bytes) noexcept {
  const std::size_t size = rtu_answer_bytes(bytes);
  if (size == 0 || size > bytes.size()) return {};
  const std::uint16_t sum = checksum(bytes.first(size - checksum_bytes));
  const bool fits = bytes[size - 2] == low_byte(sum) && bytes[size - 1] == high_byte(sum);
  return fits ? bytes.first(size) : std::span<const std::uint8_t>{};
}

std::string of_unit(std::uint8_t unit, int asked, std::span<const std::uint8_t> bytes) {
  return "unit " + std::to_string(unit) + " answered instead of unit " + std::to_string(asked) +
         " (" + hex_text(bytes) + ")";
}

std::string of_function(std::span<const std::uint8_t> pdu, int asked) {
  return "received an answer to function " + std::to_string(pdu[0] & ~exception_bit) +
         " instead of function " + std::to_string(asked) + " (" + hex_text(pdu) + ")";
}

}  // namespace

std::string hex_text(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t shown_max = 16;
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string text;
  for (const std::uint8_t byte : bytes.first(std::min(bytes.size(), shown_max))) {
    if (!text.empty()) text += ' ';
    text += digits[byte >> 4];
    text += digits[byte & 15];
  }
  return bytes.size() > shown_max ? text + " ..." : text;
}

std::span<const std::uint8_t> ModbusFrames::request(int unit, std::span<const std::uint8_t> pdu,
                                                    std::size_t answer_bytes) noexcept {
  answer_bytes_ = answer_bytes;
  begin_ = 0;
  echoed_ = late_ = false;
  other_.clear();
  std::size_t size = 0;
  const auto push = [&](std::uint8_t byte) { request_[size++] = byte; };
  if (!rtu_) {
    ++number_;
    for (const std::size_t word : {std::size_t{number_}, std::size_t{0}, pdu.size() + 1}) {
      push(high_byte(word));
      push(low_byte(word));
    }
  }
  push(static_cast<std::uint8_t>(unit));
  for (const std::uint8_t byte : pdu) push(byte);
  if (rtu_) {
    const std::uint16_t sum = checksum(std::span(request_).first(size));
    push(low_byte(sum));
    push(high_byte(sum));
  }
  request_bytes_ = size;
  return std::span(request_).first(size);
}

std::span<std::uint8_t> ModbusFrames::room() noexcept {
  if (received_ == stream_.size()) {  // keep the newest bytes only
    std::copy(stream_.begin() + frame_bytes_max, stream_.end(), stream_.begin());
    received_ -= frame_bytes_max;
    begin_ -= std::min(begin_, frame_bytes_max);
  }
  return std::span(stream_).subspan(received_);
}

void ModbusFrames::forget() noexcept {
  received_ = begin_ = unasked_ = 0;
}

bool ModbusFrames::discard() noexcept {
  begin_ = 0;
  if (rtu_) {
    received_ = 0;
    return true;
  }
  while (take_tcp()) {
  }
  // Some gateways pad their frames with zeros.
  if (std::all_of(received().begin(), received().end(), [](auto byte) { return byte == 0; }))
    received_ = 0;
  unasked_ = received_;
  return received_ < frame_bytes_max + head_bytes;
}

bool ModbusFrames::is_full() const noexcept {
  if (!rtu_) return false;
  const auto part = received().subspan(begin_);
  return part.size() >= answer_bytes_ + 1 + checksum_bytes ||
         (part.size() >= 5 && (part[1] & exception_bit) != 0);
}

ModbusFrames::Found ModbusFrames::find() {
  return rtu_ ? find_rtu() : find_tcp();
}

ModbusFrames::Found ModbusFrames::find_rtu() {
  const auto asked = std::span(request_).first(request_bytes_);
  for (std::size_t at = begin_; at < received_; ++at) {
    const auto rest = received().subspan(at);
    // The confirmation of a single register equals its request.
    const bool may_be_echo = asked[1] != write_single_register || echoes_;
    if (may_be_echo && !echoed_ && rest.size() >= asked.size() &&
        std::equal(asked.begin(), asked.end(), rest.begin())) {
      echoed_ = echoes_ = true;
      at += asked.size() - 1;
      begin_ = at + 1;
      continue;
    }
    const auto frame = rtu_answer(rest);
    if (frame.empty()) continue;
    const auto pdu = frame.subspan(1, frame.size() - 1 - checksum_bytes);
    if (frame[0] == asked[0] && (pdu[0] & ~exception_bit) == asked[1]) {
      if (!echoed_ && asked[1] != write_single_register) echoes_ = false;
      answer_ = pdu;
      return Found::answer;
    }
    other_ = frame[0] != asked[0] ? of_unit(frame[0], asked[0], frame) : of_function(pdu, asked[1]);
    at += frame.size() - 1;
    begin_ = at + 1;
  }
  return Found::nothing;
}

/// Moves a whole frame from the front of the stream into frame_. @return false if there is none
bool ModbusFrames::take_tcp() noexcept {
  if (received_ < head_bytes) return false;
  const std::size_t size = word_at(received(), 4) + std::size_t{6};
  if (size <= head_bytes || size > frame_.size() || received_ < size) return false;
  std::copy_n(stream_.begin(), size, frame_.begin());
  frame_bytes_ = size;
  std::copy(stream_.begin() + static_cast<std::ptrdiff_t>(size),
            stream_.begin() + static_cast<std::ptrdiff_t>(received_), stream_.begin());
  received_ -= size;
  return true;
}

ModbusFrames::Found ModbusFrames::find_tcp() {
  while (received_ >= head_bytes) {
    const std::size_t size = word_at(received(), 4) + std::size_t{6};
    if (word_at(received(), 2) != 0 || size <= head_bytes || size > frame_.size()) {
      other_ = rtu_answer(received()).empty()
                   ? "received bytes are not a Modbus TCP frame (" + hex_text(received()) + ")"
                   : "received a serial frame (" + hex_text(received()) +
                         "): kind = \"modbus_rtu_over_tcp\"";
      return Found::no_frame;
    }
    if (!take_tcp()) return Found::nothing;
    const bool is_unasked = unasked_ > 0;
    unasked_ -= std::min(unasked_, size);
    if (is_unasked) continue;
    const Found found = judge_tcp();
    if (found != Found::nothing) return found;
  }
  return Found::nothing;
}

ModbusFrames::Found ModbusFrames::judge_tcp() {
  constexpr int numbers_owed_max = 64;
  const auto frame = std::span<const std::uint8_t>(frame_).first(frame_bytes_);
  const std::uint16_t number = word_at(frame, 0);
  if (numbered_ && number != number_) {
    const int behind = static_cast<std::uint16_t>(number_ - number);
    late_ = number != 0 && behind < numbers_owed_max;
    other_ = "expected transaction " + std::to_string(number_) + ", got " + std::to_string(number) +
             (late_ ? ": an answer that was late"
                    : ": if the device always sends its own, "
                      "ignore_transaction = true") +
             " (" + hex_text(frame) + ")";
    return Found::nothing;
  }
  const std::uint8_t asked_unit = request_[head_bytes - 1];
  const std::uint8_t asked_function = request_[head_bytes];
  if (frame[6] != asked_unit) {
    other_ = of_unit(frame[6], asked_unit, frame);
    return Found::other;
  }
  answer_ = frame.subspan(head_bytes);
  if ((answer_[0] & ~exception_bit) == asked_function) return Found::answer;
  other_ = of_function(answer_, asked_function);
  return Found::other;
}

std::string ModbusFrames::unexpected_text() const {
  if (!other_.empty()) return other_;
  if (has_part()) {
    const auto part = received().subspan(begin_);
    const std::size_t whole = answer_bytes_ + (rtu_ ? 1 + checksum_bytes : head_bytes);
    const std::string count = std::to_string(part.size()) + " of " + std::to_string(whole) +
                              " bytes (" + hex_text(part) + ")";
    return part.size() < whole ? "incomplete answer: " + count : "wrong checksum: " + count;
  }
  return echoed_ ? "received only the echo of the request" : "";
}

namespace {

constexpr bool low_word_first(WordOrder order) noexcept {
  return order == WordOrder::cdab || order == WordOrder::dcba;
}
constexpr bool low_byte_first(WordOrder order) noexcept {
  return order == WordOrder::badc || order == WordOrder::dcba;
}
constexpr std::uint16_t swap_bytes(std::uint16_t word) noexcept {
  return static_cast<std::uint16_t>((word << 8) | (word >> 8));
}

constexpr bool is_integer(Encoding encoding) noexcept {
  return encoding != Encoding::float32 && encoding != Encoding::float64;
}

/// Range of an integer encoding.
struct Limits {
  std::int64_t lowest;
  std::int64_t highest;
};
constexpr Limits limits_of(Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
      return {std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()};
    case Encoding::uint16:
      return {0, std::numeric_limits<std::uint16_t>::max()};
    case Encoding::int32:
      return {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()};
    case Encoding::uint32:
      return {0, std::numeric_limits<std::uint32_t>::max()};
    case Encoding::float32:
    case Encoding::float64:
      break;
  }
  return {0, 0};
}

std::int64_t integer_of(std::uint64_t bits, Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
      return static_cast<std::int16_t>(static_cast<std::uint16_t>(bits));
    case Encoding::int32:
      return static_cast<std::int32_t>(static_cast<std::uint32_t>(bits));
    default:
      return static_cast<std::int64_t>(bits);  // unsigned, at most 32 bits
  }
}

/// The number in the bits of the mask.
std::uint64_t masked(std::uint64_t bits, const NumberFormat& format) noexcept {
  if (format.mask == 0xFFFF || registers_of(format.encoding) != 1) return bits;
  const int shift = std::countr_zero(format.mask);
  const unsigned part = (static_cast<unsigned>(bits) & format.mask) >> shift;
  const unsigned sign = format.encoding == Encoding::int16
                            ? std::bit_floor(static_cast<unsigned>(format.mask) >> shift)
                            : 0;
  return static_cast<std::uint16_t>((part ^ sign) - sign);
}

double number_of(std::uint64_t bits, Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::float32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case Encoding::float64:
      return std::bit_cast<double>(bits);
    default:
      return static_cast<double>(integer_of(bits, encoding));
  }
}

void place_bits(std::uint64_t bits, const NumberFormat& format, Encoded& encoded) noexcept {
  encoded.count = registers_of(format.encoding);
  for (std::size_t i = 0; i < encoded.count; ++i) {
    const auto word = static_cast<std::uint16_t>(bits >> (16 * (encoded.count - 1 - i)));
    const std::size_t place = low_word_first(format.word_order) ? encoded.count - 1 - i : i;
    encoded.registers[place] = low_byte_first(format.word_order) ? swap_bytes(word) : word;
  }
}

/// Bits of the nearest representable raw value; `saturated` if it is an end of the range.
std::uint64_t nearest_bits(double raw, Encoding encoding, bool& saturated) noexcept {
  if (encoding == Encoding::float64) return std::bit_cast<std::uint64_t>(raw);
  if (encoding == Encoding::float32) {
    constexpr double highest = std::numeric_limits<float>::max();
    saturated = std::abs(raw) > highest;
    return std::bit_cast<std::uint32_t>(
        static_cast<float>(saturated ? std::copysign(highest, raw) : raw));
  }
  const Limits limits = limits_of(encoding);
  const double rounded = std::round(raw);
  saturated =
      rounded < static_cast<double>(limits.lowest) || rounded > static_cast<double>(limits.highest);
  if (!saturated) return static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded));
  return static_cast<std::uint64_t>(raw < 0 ? limits.lowest : limits.highest);
}

}  // namespace

std::uint64_t bits_of(std::span<const std::uint16_t> registers, Encoding encoding,
                      WordOrder order) noexcept {
  const std::size_t count = registers_of(encoding);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint16_t word = registers[low_word_first(order) ? count - 1 - i : i];
    bits = (bits << 16) | (low_byte_first(order) ? swap_bytes(word) : word);
  }
  return bits;
}

Decoded decode(std::span<const std::uint16_t> registers, const NumberFormat& format,
               std::span<const Sentinel> sentinels) noexcept {
  const std::uint64_t bits = masked(bits_of(registers, format.encoding, format.word_order), format);
  const double number = number_of(bits, format.encoding);
  const bool integer = is_integer(format.encoding);
  for (const Sentinel& sentinel : sentinels) {
    const bool hit = integer ? integer_of(bits, format.encoding) == sentinel.code
                             : number == static_cast<double>(sentinel.code);
    if (hit && sentinel.fault != Fault::none) return {not_a_number, sentinel.fault};
  }
  const double value = number * format.scale + format.offset;
  if (!std::isfinite(value)) return {not_a_number, Fault::out_of_range};
  return {value, Fault::none};
}

bool may_be_measured(const ModbusChannel& channel, double temp_degC) noexcept {
  constexpr double resolved_min = 1e-6;
  if (channel.encoding != Encoding::float32 && channel.encoding != Encoding::float64) return true;
  const double raw = std::abs((temp_degC - channel.offset_degC) / channel.scale);
  return raw == 0.0 || raw >= resolved_min;
}

Fault decode_status(const ModbusStatus& status, std::uint16_t word) noexcept {
  const std::uint16_t mask = is_bit_table(status.table) ? std::uint16_t{1} : status.mask;
  const auto masked = static_cast<std::uint16_t>(word & mask);
  bool zero_is_good = masked == 0;
  for (const Sentinel& code : status.codes) {
    if (code.code == masked) return code.fault;
    if (code.fault == Fault::none) zero_is_good = false;
  }
  return zero_is_good ? Fault::none : Fault::device_error;
}

namespace {

/// True if `number`, rounded from `code`, equals it; the greatest codes are rounded to 2^63, out of
/// range.
bool is_exactly(double number, std::int64_t code) noexcept {
  return number < 0x1p63 && static_cast<std::int64_t>(number) == code;
}

}  // namespace

bool is_representable(std::int64_t code, Encoding encoding) noexcept {
  if (encoding == Encoding::float64) return is_exactly(static_cast<double>(code), code);
  if (encoding == Encoding::float32) {
    return is_exactly(static_cast<double>(static_cast<float>(code)), code);
  }
  const Limits limits = limits_of(encoding);
  return code >= limits.lowest && code <= limits.highest;
}

Encoded encode(double value, const NumberFormat& format) noexcept {
  Encoded encoded;
  const double raw = (value - format.offset) / format.scale;
  if (!std::isfinite(raw)) return encoded;
  bool saturated = false;
  const std::uint64_t bits = nearest_bits(raw, format.encoding, saturated);
  place_bits(bits, format, encoded);
  encoded.result = saturated ? EncodeResult::saturated : EncodeResult::exact;
  const std::uint64_t placed = bits_of(encoded.words(), format.encoding, format.word_order);
  encoded.value = number_of(placed, format.encoding) * format.scale + format.offset;
  return encoded;
}

}  // namespace thermocomp
