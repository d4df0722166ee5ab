/// Requests and answers of a Modbus line as bytes: made, and found again in what comes. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace thermocomp {

/// Bytes for a person, "0B 04 02 ..."; of many the first.
[[nodiscard]] std::string hex_text(std::span<const std::uint8_t> bytes);

/// The frames of one line. RTU: unit, function, data, checksum; an answer is found behind whatever
/// else comes, as the echo of the request or a byte from the switching of the line. TCP: a head
/// with a number, the length and the unit.
class ModbusFrames {
 public:
  static constexpr std::size_t frame_bytes_max = 260;

  /// @param rtu  serial frames. @param numbered  an answer carries the number of its request
  ModbusFrames(bool rtu, bool numbered) noexcept : rtu_(rtu), numbered_(numbered) {}

  /// The frame of a request. @param answer_bytes  of the expected answer's function and data
  std::span<const std::uint8_t> request(int unit, std::span<const std::uint8_t> pdu,
                                        std::size_t answer_bytes) noexcept;

  /// Where bytes that come are put; took() says how many. Never empty.
  [[nodiscard]] std::span<std::uint8_t> room() noexcept;
  void took(std::size_t bytes) noexcept { received_ += bytes; }
  /// What came before the request is no answer to it. RTU: it goes. TCP: whole frames go, the
  /// beginning of one is remembered. @return false: the stream makes no sense any more
  bool discard() noexcept;
  void forget() noexcept;  ///< the line was closed

  enum class Found {
    nothing,  ///< yet
    answer,   ///< answer() is it: of the unit, to the function
    other,    ///< came() says what
    no_frame  ///< the same, and where the next frame begins is not known
  };
  [[nodiscard]] Found look();
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return answer_; }
  /// Bytes came that are no whole frame yet.
  [[nodiscard]] bool has_part() const noexcept { return received_ > begin_; }
  /// As many bytes came as the answer has, of which none was found: nothing more is to come.
  [[nodiscard]] bool is_full() const noexcept;

  /// What came in place of the answer; empty: nothing.
  [[nodiscard]] std::string came() const;
  /// It was an answer to an earlier request, or the request's own echo.
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
  std::array<std::uint8_t, frame_bytes_max> frame_{};  ///< TCP: taken last
  std::size_t frame_bytes_{0};
  std::array<std::uint8_t, 3 * frame_bytes_max> stream_{};
  std::size_t received_{0};  ///< bytes of stream_
  std::size_t begin_{0};     ///< RTU: bytes of it that are no answer
  std::size_t unasked_{0};   ///< TCP: bytes at its front that were there before the request
  std::span<const std::uint8_t> answer_;
  bool echoes_{false};  ///< RTU: the line brings its own requests back
  // Of the exchange under way
  bool echoed_{false};
  bool late_{false};
  std::string other_;
};

}  // namespace thermocomp
