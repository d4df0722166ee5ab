#include "drivers/can/canopen/sdo_client.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr std::uint32_t request_id = 0x600;
constexpr std::size_t frame_bytes = 8;
constexpr std::size_t header_bytes = 4;
constexpr std::size_t segment_bytes = 7;
constexpr std::size_t expedited_bytes = 4;

// Command specifiers: the three highest bits of the first byte.
constexpr std::uint8_t specifier_mask = 0xE0;
constexpr std::uint8_t ask_write = 0x20;
constexpr std::uint8_t ask_read = 0x40;
constexpr std::uint8_t ask_read_segment = 0x60;
constexpr std::uint8_t response_segment = 0x00;
constexpr std::uint8_t response_read = 0x40;
constexpr std::uint8_t response_written = 0x60;
constexpr std::uint8_t response_abort = 0x80;
constexpr std::uint8_t segment_toggle_bit = 0x10;
constexpr std::uint8_t expedited_bit = 0x02;
constexpr std::uint8_t size_bit = 0x01;
constexpr std::uint8_t last_segment_bit = 0x01;

constexpr std::uint32_t toggle_not_alternated = 0x05030000;
constexpr std::uint32_t protocol_timed_out = 0x05040000;
constexpr std::uint32_t unknown_specifier = 0x05040001;
constexpr std::uint32_t out_of_memory = 0x05040005;
constexpr std::uint32_t length_does_not_match = 0x06070010;

struct AbortName {
  std::uint32_t code;
  std::string_view name;
};
constexpr std::array<AbortName, 31> abort_names{{
    {0x05030000, "toggle bit not alternated"},
    {0x05040000, "protocol timed out"},
    {0x05040001, "command specifier not valid"},
    {0x05040002, "invalid block size"},
    {0x05040003, "invalid sequence number"},
    {0x05040004, "CRC error"},
    {0x05040005, "out of memory"},
    {0x06010000, "unsupported access"},
    {0x06010001, "object is write only"},
    {0x06010002, "object is read only"},
    {0x06020000, "object does not exist"},
    {0x06040041, "object cannot be mapped to the PDO"},
    {0x06040042, "mapped objects exceed the PDO's length"},
    {0x06040043, "parameters incompatible"},
    {0x06040047, "internal incompatibility in the device"},
    {0x06060000, "hardware error"},
    {0x06070010, "length does not match"},
    {0x06070012, "length too high"},
    {0x06070013, "length too low"},
    {0x06090011, "sub-index does not exist"},
    {0x06090030, "invalid value"},
    {0x06090031, "value too high"},
    {0x06090032, "value too low"},
    {0x06090036, "maximum is less than minimum"},
    {0x060A0023, "resource not available"},
    {0x08000000, "general error"},
    {0x08000020, "data cannot be transferred or stored"},
    {0x08000021, "local control forbids it"},
    {0x08000022, "the device's state forbids it"},
    {0x08000023, "no object dictionary"},
    {0x08000024, "no data available"},
}};

}  // namespace

std::string_view sdo_abort_name(std::uint32_t code) noexcept {
  const auto* found = std::find_if(abort_names.begin(), abort_names.end(),
                                   [&](const AbortName& each) { return each.code == code; });
  return found == abort_names.end() ? "unknown abort code" : found->name;
}

std::string seconds_text(nanoseconds time) {
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%g", static_cast<double>(time.count()) * 1e-9);
  return text.data();
}

std::string to_string(const ObjectAddress& object) {
  std::array<char, 12> text{};
  std::snprintf(text.data(), text.size(), "%04X:%02X", static_cast<unsigned>(object.index),
                static_cast<unsigned>(object.sub));
  return text.data();
}

std::string to_string(const SdoResult& result) {
  std::string text = to_string(result.object);
  switch (result.outcome) {
    case SdoOutcome::done:
      return text.append(": done");
    case SdoOutcome::timed_out:
      return text + ": no answer within sdo_timeout_s = " + seconds_text(result.timeout);
    case SdoOutcome::aborted:
      text.append(": aborted by the node: ");
      break;
    case SdoOutcome::broken:
      text.append(": not an answer to the request: ");
      break;
  }
  return text.append(hexadecimal(result.abort_code, 8))
      .append(" ")
      .append(sdo_abort_name(result.abort_code));
}

void SdoClient::send(std::uint8_t command, ObjectAddress object, std::uint32_t data) {
  CanFrame frame;
  frame.id = {request_id + static_cast<std::uint32_t>(node_), false};
  frame.size = frame_bytes;
  frame.data[0] = command;
  put_little_endian(frame.data, 1, 2, object.index);
  frame.data[3] = object.sub;
  put_little_endian(frame.data, 4, 4, data);
  frames_.push_back(frame);
}

void SdoClient::begin(ObjectAddress object, State state, nanoseconds now) {
  THERMOCOMP_ENSURE(!busy());
  object_ = object;
  state_ = state;
  answered_ = false;
  bytes_.clear();
  result_.reset();
  deadline_ = now + timeout_;
}

void SdoClient::read(ObjectAddress object, nanoseconds now) {
  begin(object, State::reading, now);
  send(ask_read, object, 0);
}

void SdoClient::write(ObjectAddress object, std::span<const std::uint8_t> bytes, nanoseconds now) {
  THERMOCOMP_ENSURE(!bytes.empty() && bytes.size() <= expedited_bytes);
  begin(object, State::writing, now);
  const std::size_t unused = expedited_bytes - bytes.size();
  send(static_cast<std::uint8_t>(ask_write | (unused << 2) | expedited_bit | size_bit), object,
       static_cast<std::uint32_t>(little_endian(bytes, 0, expedited_bytes)));
}

void SdoClient::cancel() noexcept {
  state_ = State::idle;
  answered_ = false;
  frames_.clear();
  result_.reset();
}

void SdoClient::end(SdoOutcome outcome, std::uint32_t abort_code) {
  state_ = State::idle;
  answered_ = outcome == SdoOutcome::done || outcome == SdoOutcome::aborted;
  if (outcome != SdoOutcome::done) bytes_.clear();
  result_ = SdoResult{object_, outcome, abort_code, std::move(bytes_), timeout_};
  bytes_.clear();
}

void SdoClient::abort(SdoOutcome outcome, std::uint32_t abort_code) {
  send(response_abort, object_, abort_code);
  end(outcome, abort_code);
}

/// Bytes needed to read the answer. Old nodes send no more; CiA 301 requires all eight.
std::size_t SdoClient::bytes_used(std::span<const std::uint8_t> data) noexcept {
  const std::uint8_t specifier = data[0] & specifier_mask;
  if (specifier == response_segment) return frame_bytes - ((data[0] >> 1) & 7u);
  if (specifier != response_read || (data[0] & expedited_bit) == 0) {
    return specifier == response_read && (data[0] & size_bit) != 0 ? frame_bytes : header_bytes;
  }
  return (data[0] & size_bit) != 0 ? frame_bytes - ((data[0] >> 2) & 3u) : header_bytes + 1;
}

void SdoClient::take(std::span<const std::uint8_t> data, nanoseconds now) {
  if (data.empty()) return;
  const std::uint8_t specifier = data[0] & specifier_mask;
  const bool names_object = specifier != response_segment;
  const bool ours = data.size() >= header_bytes && little_endian(data, 1, 2) == object_.index &&
                    data[3] == object_.sub;
  if (!busy()) {
    if (answered_ && names_object && ours) ++second_answers_;
    return;
  }
  // A late answer to an earlier request.
  if (names_object && !ours && data.size() >= header_bytes) return;
  if (specifier == response_abort) {
    end(SdoOutcome::aborted, static_cast<std::uint32_t>(little_endian(data, 4, 4)));
  } else if (data.size() < bytes_used(data)) {
    abort(SdoOutcome::broken, length_does_not_match);
  } else if (state_ == State::writing && specifier == response_written) {
    end(SdoOutcome::done, 0);
  } else if (state_ == State::reading && specifier == response_read) {
    take_first(data, now);
  } else if (state_ == State::reading_segments && specifier == response_segment) {
    take_segment(data, now);
  } else if (specifier == response_read || specifier == response_written) {
    ++second_answers_;  // already answered: a second node answers
  } else {
    abort(SdoOutcome::broken, unknown_specifier);
  }
}

/// Answer to "initiate upload": the value itself, or its length.
void SdoClient::take_first(std::span<const std::uint8_t> data, nanoseconds now) {
  const bool expedited = (data[0] & expedited_bit) != 0;
  const bool sized = (data[0] & size_bit) != 0;
  if (expedited) {
    const auto value = data.subspan(header_bytes);
    const std::size_t unused = sized ? (data[0] >> 2) & 3u : 0u;
    const std::size_t bytes = std::min(value.size(), expedited_bytes - unused);
    bytes_.assign(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(bytes));
    end(SdoOutcome::done, 0);
    return;
  }
  announced_ = sized ? static_cast<std::size_t>(little_endian(data, 4, 4)) : 0;
  if (announced_ > bytes_max) {
    abort(SdoOutcome::broken, out_of_memory);
    return;
  }
  state_ = State::reading_segments;
  toggle_ = false;
  ask_segment(now);
}

void SdoClient::ask_segment(nanoseconds now) {
  deadline_ = now + timeout_;
  send(static_cast<std::uint8_t>(ask_read_segment | (toggle_ ? segment_toggle_bit : 0)), {}, 0);
}

void SdoClient::take_segment(std::span<const std::uint8_t> data, nanoseconds now) {
  if (((data[0] & segment_toggle_bit) != 0) != toggle_) {
    abort(SdoOutcome::broken, toggle_not_alternated);
    return;
  }
  const std::size_t unused = (data[0] >> 1) & 7u;
  const auto first = data.begin() + 1;
  bytes_.insert(bytes_.end(), first, first + static_cast<std::ptrdiff_t>(segment_bytes - unused));
  const bool last = (data[0] & last_segment_bit) != 0;
  if (bytes_.size() > bytes_max) {
    abort(SdoOutcome::broken, out_of_memory);
  } else if (last && announced_ != 0 && bytes_.size() != announced_) {
    abort(SdoOutcome::broken, length_does_not_match);
  } else if (last) {
    end(SdoOutcome::done, 0);
  } else {
    toggle_ = !toggle_;
    ask_segment(now);
  }
}

void SdoClient::advance(nanoseconds now) {
  if (busy() && now >= deadline_) abort(SdoOutcome::timed_out, protocol_timed_out);
}

std::optional<CanFrame> SdoClient::next_frame() {
  if (frames_.empty()) return std::nullopt;
  const CanFrame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

std::optional<SdoResult> SdoClient::result() {
  std::optional<SdoResult> given = std::move(result_);
  result_.reset();
  return given;
}

}  // namespace thermocomp
