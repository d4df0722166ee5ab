/// Modbus requests and answers as bytes: encoding, and search in the received stream. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace thermocomp {

/// "0B 04 02 ...", for display; a long text is cut.
[[nodiscard]] std::string hex_text(std::span<const std::uint8_t> bytes);

/// Frames of one line. RTU: unit, function, data, checksum; an answer is also found after unrelated
/// bytes, such as the echo of the request or a byte from switching the line. TCP: header with
/// transaction id, length and unit.
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
  /// kept. @return false: the stream is out of step
  bool discard() noexcept;
  void forget() noexcept;  ///< the line was closed

  enum class Found {
    nothing,  ///< not yet
    answer,   ///< answer() of the unit, to the function
    other,    ///< another frame, see came()
    no_frame  ///< the same, and the start of the next frame is unknown
  };
  [[nodiscard]] Found look();
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return answer_; }
  /// A frame is incomplete.
  [[nodiscard]] bool has_part() const noexcept { return received_ > begin_; }
  /// As many bytes as the answer has were received, without an answer: no more are expected.
  [[nodiscard]] bool is_full() const noexcept;

  /// Description of bytes received in place of the answer; empty: none.
  [[nodiscard]] std::string came() const;
  /// They were an answer to an earlier request, or the echo of this one.
  [[nodiscard]] bool came_late() const noexcept { return late_ || (echoed_ && other_.empty()); }

 private:
  [[nodiscard]] std::span<const std::uint8_t> received() const noexcept {
    return std::span(stream_).first(received_);
  }
  [[nodiscard]] Found look_rtu();
  [[nodiscard]] Found look_tcp();
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
  // Of the present exchange:
  bool echoed_{false};
  bool late_{false};
  std::string other_;
};

}  // namespace thermocomp
