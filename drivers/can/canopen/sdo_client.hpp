/// Client of CANopen SDOs (CiA 301, 7.2.4): one transfer at a time with one node. Pure.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/can/can_socket.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp {

/// Name of an abort code; "unknown abort code" if it is not in CiA 301.
[[nodiscard]] std::string_view sdo_abort_name(std::uint32_t code) noexcept;

/// "1017:00"
[[nodiscard]] std::string to_string(const ObjectAddress& object);

enum class SdoOutcome {
  done,
  aborted,  ///< by the node, with abort_code
  timed_out,
  broken  ///< protocol violation by the node, answered with abort_code
};

struct SdoResult {
  ObjectAddress object;
  SdoOutcome outcome{SdoOutcome::done};
  std::uint32_t abort_code{0};
  std::vector<std::uint8_t> bytes;  ///< value read; empty after a write
  nanoseconds timeout{};
};

/// "2040:01: aborted by the node: 0x06020000 object does not exist"
[[nodiscard]] std::string to_string(const SdoResult& result);

/// Reads expedited and segmented (at most bytes_max), writes expedited (1..4 bytes). Accepts
/// answers without the unused bytes.
class SdoClient {
 public:
  static constexpr std::size_t bytes_max = 1024;

  SdoClient(int node, nanoseconds timeout) noexcept : node_(node), timeout_(timeout) {}

  /// @pre !busy()
  void read(ObjectAddress object, nanoseconds now);
  /// @pre !busy(), 1..4 bytes
  void write(ObjectAddress object, std::span<const std::uint8_t> bytes, nanoseconds now);
  /// Drops the transfer; nothing is sent to the node.
  void cancel() noexcept;

  [[nodiscard]] bool busy() const noexcept { return state_ != State::idle; }
  /// Time of the next advance(); only while busy.
  [[nodiscard]] nanoseconds deadline() const noexcept { return deadline_; }

  /// A frame with the node's response identifier (0x580 + node).
  void take(std::span<const std::uint8_t> data, nanoseconds now);
  void advance(nanoseconds now);

  /// Frames to send, oldest first; each is returned once.
  [[nodiscard]] std::optional<CanFrame> next_frame();
  /// Result of a finished transfer; returned once.
  [[nodiscard]] std::optional<SdoResult> result();
  /// Number of answers to transfers that were already answered: a second node has the same number.
  [[nodiscard]] std::uint64_t second_answers() const noexcept { return second_answers_; }

 private:
  enum class State { idle, reading, reading_segments, writing };

  void begin(ObjectAddress object, State state, nanoseconds now);
  void send(std::uint8_t command, ObjectAddress object, std::uint32_t data);
  void ask_segment(nanoseconds now);
  static std::size_t bytes_used(std::span<const std::uint8_t> data) noexcept;
  void take_first(std::span<const std::uint8_t> data, nanoseconds now);
  void take_segment(std::span<const std::uint8_t> data, nanoseconds now);
  void end(SdoOutcome outcome, std::uint32_t abort_code);
  void abort(SdoOutcome outcome, std::uint32_t abort_code);

  int node_;
  nanoseconds timeout_;
  State state_{State::idle};
  ObjectAddress object_;
  bool answered_{false};  ///< the last transfer ended with an answer of the node
  bool toggle_{false};
  std::size_t announced_{0};  ///< bytes of a segmented transfer; 0: not announced
  std::vector<std::uint8_t> bytes_;
  nanoseconds deadline_{};
  std::deque<CanFrame> frames_;
  std::optional<SdoResult> result_;
  std::uint64_t second_answers_{0};
};

}  // namespace thermocomp
