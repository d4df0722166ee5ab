/// A line with the fuzzer at its far end, and a clock that advances only during waits.
///
/// virtual_line.cpp defines the C library's calls of drivers and libmodbus (ppoll, recv, send,
/// connect, select, read, write, recvmmsg, clock_gettime, ...). While a VirtualLine exists, calls
/// on its descriptor and the monotonic clock are answered from its script, so that timeouts take no
/// time and runs are reproducible; other calls go to the kernel.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include <sys/socket.h>

namespace thermocomp::fuzz {

using std::chrono::nanoseconds;

class VirtualLine {
 public:
  /// A part of the received data, with its delay after the previous part.
  struct Piece {
    nanoseconds delay{};
    std::vector<std::uint8_t> bytes;
    bool hang_up{false};  ///< after this part the peer is gone
  };
  /// Called with every request sent; the answer arrives in these pieces.
  using Peer = std::function<std::vector<Piece>(std::span<const std::uint8_t> request)>;

  explicit VirtualLine(Peer peer);
  ~VirtualLine();
  VirtualLine(const VirtualLine&) = delete;
  VirtualLine& operator=(const VirtualLine&) = delete;

  [[nodiscard]] nanoseconds now() const noexcept { return now_; }
  /// All data that have arrived, read or not.
  [[nodiscard]] const std::vector<std::uint8_t>& arrived() const noexcept { return arrived_; }
  /// Without the data present before the newest request was sent.
  [[nodiscard]] std::span<const std::uint8_t> arrived_since_asked() const noexcept {
    return std::span(arrived_).subspan(asked_at_);
  }

  // Implementation of the C library's calls.
  [[nodiscard]] nanoseconds tick() noexcept;
  /// @return true if data or the hang-up can be read by `until`
  bool wait_readable(nanoseconds until);
  void pass(nanoseconds until) noexcept;
  ssize_t read(void* to, std::size_t size);
  ssize_t write(const void* from, std::size_t size);
  void throw_away();

 private:
  void arrive();

  Peer peer_;
  nanoseconds now_{std::chrono::hours(1)};
  nanoseconds due_{now_};  ///< arrival of the last piece in transit
  struct Due {
    nanoseconds at{};
    Piece piece;
  };
  std::deque<Due> under_way_;
  std::vector<std::uint8_t> arrived_;
  std::size_t taken_{0};
  std::size_t asked_at_{0};
  bool hung_up_{false};
};

/// Frames and control messages of recvmmsg on a CAN socket, which this kernel may not support.
class VirtualCan {
 public:
  /// Fills one message. @return false if there is none
  using Next = std::function<bool(mmsghdr& message)>;
  explicit VirtualCan(Next next);
  ~VirtualCan();
  VirtualCan(const VirtualCan&) = delete;
  VirtualCan& operator=(const VirtualCan&) = delete;
  Next next;
};

}  // namespace thermocomp::fuzz
