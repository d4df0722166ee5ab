/// Modbus requests and answers as bytes, and registers <-> numbers. Pure: no I/O, no clock.
/// Conversions of numbers neither allocate nor throw.
///
/// A register is a host uint16 as from libmodbus (the first byte on the wire is its high byte). A
/// value of 2 or 4 registers is in consecutive registers, lowest address first. Bytes on the wire,
/// A the most significant:
///
///   order   16 bit   32 bit   64 bit       words        bytes in a word
///   abcd    AB       ABCD     ABCDEFGH     high first   high first
///   cdab    AB       CDAB     GHEFCDAB     low first    high first
///   badc    BA       BADC     BADCFEHG     high first   low first
///   dcba    BA       DCBA     HGFEDCBA     low first    low first
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

inline constexpr std::uint8_t exception_bit = 0x80;  ///< of the function code of an answer

/// The big-endian 16 bit number at `at`. @pre at + 1 < bytes.size()
[[nodiscard]] constexpr std::uint16_t word_at(std::span<const std::uint8_t> bytes,
                                              std::size_t at) noexcept {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}

/// "0B 04 02 ...", for display; long data is cut.
[[nodiscard]] std::string hex_text(std::span<const std::uint8_t> bytes);

/// Frames of one line. RTU: unit, function, data, checksum; an answer is also found after unrelated
/// bytes (echo of the request, a byte from switching the line). TCP: header with transaction id,
/// length and unit.
class ModbusFrames {
 public:
  static constexpr std::size_t frame_bytes_max = 260;

  /// @param rtu  serial frames. @param numbered  answers carry their request's transaction id
  ModbusFrames(bool rtu, bool numbered) noexcept : rtu_(rtu), numbered_(numbered) {}

  /// Frame of a request. @param answer_bytes  of the expected answer's function and data
  std::span<const std::uint8_t> request(int unit, std::span<const std::uint8_t> pdu,
                                        std::size_t answer_bytes) noexcept;

  /// Buffer for received bytes; took() gives their number. Never empty.
  [[nodiscard]] std::span<std::uint8_t> room() noexcept;
  void took(std::size_t bytes) noexcept { received_ += bytes; }
  /// Discards bytes received before the request. RTU: all. TCP: whole frames; the start of one is
  /// kept. @return false if the stream is out of step
  bool discard() noexcept;
  void forget() noexcept;  ///< the line was closed

  enum class Found {
    nothing,  ///< not yet
    answer,   ///< answer() of the unit, to the function
    other,    ///< another frame, see unexpected_text()
    no_frame  ///< as `other`, and the start of the next frame is unknown
  };
  [[nodiscard]] Found find();
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return answer_; }
  /// True if a frame is incomplete.
  [[nodiscard]] bool has_part() const noexcept { return received_ > begin_; }
  /// True if as many bytes as the answer has were received, without an answer: no more are
  /// expected.
  [[nodiscard]] bool is_full() const noexcept;

  /// Description of bytes received instead of the answer; empty: none.
  [[nodiscard]] std::string unexpected_text() const;
  /// True if they were an answer to an earlier request, or the echo of this one.
  [[nodiscard]] bool is_late_or_echo() const noexcept {
    return late_ || (echoed_ && other_.empty());
  }

 private:
  [[nodiscard]] std::span<const std::uint8_t> received() const noexcept {
    return std::span(stream_).first(received_);
  }
  [[nodiscard]] Found find_rtu();
  [[nodiscard]] Found find_tcp();
  bool take_tcp() noexcept;
  [[nodiscard]] Found judge_tcp();

  bool rtu_;
  bool numbered_;
  std::uint16_t number_{0};
  std::array<std::uint8_t, frame_bytes_max> request_{};
  std::size_t request_bytes_{0};
  std::size_t answer_bytes_{0};
  std::array<std::uint8_t, frame_bytes_max> frame_{};  ///< TCP: last frame
  std::size_t frame_bytes_{0};
  std::array<std::uint8_t, 3 * frame_bytes_max> stream_{};
  std::size_t received_{0};  ///< bytes of stream_
  std::size_t begin_{0};     ///< RTU: of these, not part of an answer
  std::size_t unasked_{0};   ///< TCP: of these, received before the request
  std::span<const std::uint8_t> answer_;
  bool echoes_{false};  ///< RTU: the line echoes our requests
  // The present exchange:
  bool echoed_{false};
  bool late_{false};
  std::string other_;
};

inline constexpr std::size_t registers_of_value_max = 4;

/// Format of a number in registers: value = raw * scale + offset.
struct NumberFormat {
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  double scale{1.0};
  double offset{0.0};
  /// Bits of a 16-bit value that are the number, shifted down. int16: the highest is the sign.
  std::uint16_t mask{0xFFFF};
};

/// Format of a value in `table`; a bit is always 0 or 1 before scale and offset.
[[nodiscard]] inline NumberFormat format_in(ModbusTable table, NumberFormat format) noexcept {
  if (!is_bit_table(table)) return format;
  return {Encoding::uint16, WordOrder::abcd, format.scale, format.offset};
}

[[nodiscard]] inline NumberFormat format_of(const ModbusChannel& channel) noexcept {
  return format_in(channel.table, {channel.encoding, channel.word_order, channel.scale,
                                   channel.offset_degC, channel.mask});
}

/// Bit pattern of the value, right-aligned, most significant byte first.
/// @pre registers.size() >= registers_of(encoding)
[[nodiscard]] std::uint64_t bits_of(std::span<const std::uint16_t> registers, Encoding encoding,
                                    WordOrder order) noexcept;

struct Decoded {
  double value{not_a_number};  ///< NaN unless fault is none
  Fault fault{Fault::none};
};

/// value = raw * scale + offset, unless the raw value is a sentinel (its fault) or the result is
/// not a finite number (out_of_range). A sentinel of a float encoding is compared as a number.
/// @pre registers.size() >= registers_of(format.encoding)
[[nodiscard]] Decoded decode(std::span<const std::uint16_t> registers, const NumberFormat& format,
                             std::span<const Sentinel> sentinels) noexcept;

/// False for a float that no thermometer sends: closer to 0 than any of them resolves, it comes
/// from the bytes of another number (wrong word_order or address). 0 itself is possible.
[[nodiscard]] bool may_be_measured(const ModbusChannel& channel, double temp_degC) noexcept;

/// Fault (or none) of a status word: the one listed for its masked value. 0 is good if no good code
/// is listed; any other value is device_error. A bit (coil, discrete input) is not masked.
[[nodiscard]] Fault decode_status(const ModbusStatus& status, std::uint16_t word) noexcept;

/// True if a sentinel's code can occur in the encoding (-1 cannot in uint16).
[[nodiscard]] bool is_representable(std::int64_t code, Encoding encoding) noexcept;

enum class EncodeResult {
  exact,      ///< within half a count (integers) or the float's rounding
  saturated,  ///< beyond the encoding: its nearest end
  refused     ///< not a finite number: nothing to write
};

struct Encoded {
  std::array<std::uint16_t, registers_of_value_max> registers{};
  std::size_t count{0};  ///< registers to write; 0 when refused
  EncodeResult result{EncodeResult::refused};
  double value{not_a_number};  ///< decoded from these registers

  [[nodiscard]] std::span<const std::uint16_t> words() const noexcept {
    return {registers.data(), count};
  }
};

/// raw = (value - offset) / scale, rounded to the nearest count (halves away from zero).
/// @pre format.scale is finite and not 0 (otherwise refused)
[[nodiscard]] Encoded encode(double value, const NumberFormat& format) noexcept;

}  // namespace thermocomp
