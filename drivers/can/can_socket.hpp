/// SocketCAN raw socket with filters in the kernel, receive time stamps and reopening.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/can/signal_codec.hpp"

struct msghdr;

namespace thermocomp {

using std::chrono::nanoseconds;

struct CanId {
  std::uint32_t id{0};  ///< 11 or 29 bits
  bool extended{false};
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 sees a null pointer in every default <=>
  auto operator<=>(const CanId&) const = default;
};
/// "0x0F" with two digits
[[nodiscard]] std::string hexadecimal(std::uint64_t number, int digits);
/// "0x281", "0x18FF2F31"
[[nodiscard]] std::string to_string(const CanId& id);

/// True if frames with this identifier carry the signal.
[[nodiscard]] inline bool matches(const CanId& id, const CanSignal& signal) noexcept {
  return id.extended == signal.extended_id && ((id.id ^ signal.id) & signal.id_mask) == 0;
}

/// Identifiers of the same length that match `id` in the bits of `mask`.
struct CanFilter {
  CanId id;
  std::uint32_t mask{0x1FFFFFFF};
};

struct CanFrame {
  CanId id;
  std::size_t size{0};  ///< bytes of data, 0..8 or, in an FD frame, 0..64
  bool fd{false};
  std::array<std::uint8_t, can_bytes_max> data{};
  nanoseconds received_at{};  ///< CLOCK_MONOTONIC
  [[nodiscard]] std::span<const std::uint8_t> payload() const noexcept {
    return {data.data(), size};
  }
};

/// State of the interface; active, warning and passive are the error states of ISO 11898-1.
enum class CanState {
  down,  ///< not open: the interface is missing or not up
  active,
  warning,
  passive,
  bus_off  ///< the interface is off the bus until it is restarted
};
[[nodiscard]] std::string_view to_string(CanState state) noexcept;

/// Counts of error frames and kernel reports since construction.
struct CanErrors {
  std::uint64_t error_frames{0};
  std::uint64_t bus_off{0};
  std::uint64_t error_passive{0};
  std::uint64_t error_warning{0};
  std::uint64_t restarted{0};
  std::uint64_t dropped{0};  ///< by the kernel, because the socket's queue was full
};

/// Empty if the system has CAN sockets; else the kernel's error.
[[nodiscard]] std::string can_unavailable();

/// Monotonic time of an event with a wall-clock stamp: now less its age, limited to [now - 1 s,
/// now], so that a step of the wall clock makes a reading neither stale nor fresh for ever.
[[nodiscard]] nanoseconds monotonic_stamp(nanoseconds realtime_stamp, nanoseconds realtime_now,
                                          nanoseconds monotonic_now) noexcept;

/// Smallest valid frame size of at least `size` bytes: above 8 bytes only some sizes exist.
/// @pre size <= can_bytes_max
[[nodiscard]] std::size_t whole_frame_bytes(std::size_t size) noexcept;

/// One bus through one socket, classic and FD frames; for one thread. Faults are data: after
/// construction no method throws (except for lack of memory). A lost link closes the socket;
/// error() gives the reason.
class CanSocket {
 public:
  static constexpr std::size_t filters_max = 512;  ///< the kernel's CAN_RAW_FILTER_MAX
  static constexpr std::size_t batch_max = 128;    ///< frames per receive()

  /// @param wanted  identifiers to receive, duplicates allowed; the kernel drops all others
  /// @throws InvalidValue for more than filters_max identifiers or an impossible interface name
  CanSocket(std::string interface, std::vector<CanId> wanted);
  /// Adds identifiers to receive, from the next open() on.
  /// @throws InvalidValue for more than filters_max filters in all
  void add_filter(const CanFilter& filter);
  /// Sent frames with these identifiers count as sent_out() once they have left the interface, from
  /// the next open() on.
  /// @throws InvalidValue for more than filters_max filters in all
  void watch_own(const std::vector<CanId>& ids);
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;
  ~CanSocket();

  /// Opens and binds; fails for an interface that is missing or down. @return true on success
  bool open();
  void close() noexcept;
  [[nodiscard]] bool is_open() const noexcept { return socket_ >= 0; }
  /// Readable when receive() has frames; -1 when closed.
  [[nodiscard]] int descriptor() const noexcept { return socket_; }

  /// Returns received frames without waiting, at most batch_max; valid until the next call. Error
  /// frames are counted, not returned. Closes the socket when the link is lost.
  [[nodiscard]] std::span<const CanFrame> receive();
  /// Sends a frame; one of more than 8 bytes as CAN FD, zero-padded to a valid size.
  /// @return false when the kernel did not take the frame; the link may then be lost
  bool send(const CanFrame& frame);

  /// Frames of watch_own() that receive() has seen leave the interface since the last open().
  [[nodiscard]] std::uint64_t sent_out() const noexcept { return sent_out_; }
  [[nodiscard]] const CanErrors& errors() const noexcept { return errors_; }
  [[nodiscard]] CanState state() const noexcept { return state_; }
  /// CLOCK_MONOTONIC of the last change of state().
  [[nodiscard]] nanoseconds state_since() const noexcept { return state_since_; }
  /// True while the CAN controller is off the bus: no frame and no restart since.
  [[nodiscard]] bool bus_off() const noexcept { return state_ == CanState::bus_off; }
  /// Reason of the last failed open(), receive() or send(), or the bus' error state; else empty.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

 private:
  struct Buffers;

  bool configure();
  void ask_for_room() noexcept;
  void enter(CanState state);
  void report_state();
  void look_for_carrier();
  /// Ends bus-off: the kernel has restarted the interface, or a frame has come later than
  /// carrier_delay after the bus-off. An earlier one may have been on its way; of an interface that
  /// returns no sent frames itself (a serial adapter), the kernel returns them although nothing is
  /// sent.
  void returned();
  void fail(const char* what, int code);
  /// Kernel time stamp of a frame; also records the kernel's count of dropped frames.
  std::optional<nanoseconds> read_control(msghdr& header);
  void note_error_frame(std::uint32_t error_class, std::span<const std::uint8_t> data);
  void note_error_state(unsigned bits);

  std::string interface_;
  std::vector<CanId> wanted_;
  std::vector<CanFilter> filters_;
  bool watches_own_{false};
  std::uint64_t sent_out_{0};
  int socket_{-1};
  CanState state_{CanState::down};
  nanoseconds state_since_;
  /// Opened without a carrier, as after a bus-off; no error frame reports the past.
  bool without_carrier_{false};
  /// An opened socket checks the carrier until then.
  nanoseconds carrier_known_at_{};
  bool send_failed_{false};
  std::string error_;
  CanErrors errors_;
  std::uint32_t dropped_by_socket_{0};  ///< the kernel's counter, which starts with the socket
  std::unique_ptr<Buffers> buffers_;
  std::vector<CanFrame> received_;
};

}  // namespace thermocomp
