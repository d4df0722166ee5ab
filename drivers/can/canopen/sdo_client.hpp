/// The client's side of CANopen's service data objects (CiA 301, 7.2.4): one transfer at a time
/// with one node. Pure: frames and times in, frames and results out.
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

/// What a node means by an abort code; "unknown abort code" for one that is not in CiA 301.
[[nodiscard]] std::string_view sdo_abort_name(std::uint32_t code) noexcept;

/// "1017:00"
[[nodiscard]] std::string to_string(const ObjectAddress& object);

enum class SdoOutcome {
  done,
  aborted,  ///< by the node, abort_code says why
  timed_out,
  broken  ///< the node broke the protocol, abort_code is what it was sent
};

struct SdoResult {
  ObjectAddress object;
  SdoOutcome outcome{SdoOutcome::done};
  std::uint32_t abort_code{0};
  std::vector<std::uint8_t> bytes;  ///< what was read; empty after a write
  nanoseconds timeout{};
};

/// "2040:01: aborted by the node: 0x06020000 object does not exist"
[[nodiscard]] std::string to_string(const SdoResult& result);

/// Reads expedited and segmented (at most bytes_max), writes expedited (1..4 bytes). An answer that
/// leaves out bytes of no use is taken.
class SdoClient {
 public:
  static constexpr std::size_t bytes_max = 1024;

  SdoClient(int node, nanoseconds timeout) noexcept : node_(node), timeout_(timeout) {}

  /// @pre !busy()
  void read(ObjectAddress object, nanoseconds now);
  /// @pre !busy(), 1..4 bytes
  void write(ObjectAddress object, std::span<const std::uint8_t> bytes, nanoseconds now);
  /// Forgets the transfer; nothing is sent to the node.
  void cancel() noexcept;

  [[nodiscard]] bool busy() const noexcept { return state_ != State::idle; }
  /// When advance() has something to do; only while busy.
  [[nodiscard]] nanoseconds deadline() const noexcept { return deadline_; }

  /// A frame of the node's answering identifier (0x580 + node).
  void take(std::span<const std::uint8_t> data, nanoseconds now);
  void advance(nanoseconds now);

  /// Frames to send, oldest first; each is given once.
  [[nodiscard]] std::optional<CanFrame> next_frame();
  /// The end of a transfer; given once.
  [[nodiscard]] std::optional<SdoResult> result();
  /// Number of answers to transfers that had already been answered: another node has the same
  /// number.
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
  bool answered_{false};  ///< the last transfer ended with the node's own answer
  bool toggle_{false};
  std::size_t announced_{0};  ///< bytes of a segmented transfer; 0: not announced
  std::vector<std::uint8_t> bytes_;
  nanoseconds deadline_{};
  std::deque<CanFrame> frames_;
  std::optional<SdoResult> result_;
  std::uint64_t second_answers_{0};
};

}  // namespace thermocomp
