/// A line whose far end is the fuzzer, and a clock that moves only while somebody waits.
///
/// virtual_line.cpp defines the C library's calls that drivers and libmodbus make (ppoll, recv,
/// send, connect, select, read, write, recvmmsg, clock_gettime, ...). While a VirtualLine exists,
/// those about its descriptor and the monotonic clock are answered from its script, so that a
/// time-out costs no time and every run of an input is the same; otherwise they go to the kernel.
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
  /// What arrives, and how long after what came before it.
  struct Piece {
    nanoseconds delay{};
    std::vector<std::uint8_t> bytes;
    bool hang_up{false};  ///< then the peer is gone
  };
  /// Called with every request that is sent; its answer arrives in these pieces.
  using Peer = std::function<std::vector<Piece>(std::span<const std::uint8_t> request)>;

  explicit VirtualLine(Peer peer);
  ~VirtualLine();
  VirtualLine(const VirtualLine&) = delete;
  VirtualLine& operator=(const VirtualLine&) = delete;

  [[nodiscard]] nanoseconds now() const noexcept { return now_; }
  /// Everything that has arrived so far, read or not.
  [[nodiscard]] const std::vector<std::uint8_t>& arrived() const noexcept { return arrived_; }
  /// The same, but for what was there before the newest request began to be sent.
  [[nodiscard]] std::span<const std::uint8_t> arrived_since_asked() const noexcept {
    return std::span(arrived_).subspan(asked_at_);
  }

  // What the calls of the C library do.
  [[nodiscard]] nanoseconds tick() noexcept;
  /// @return whether something (or the hang-up) is there to be read, at the latest at `until`
  bool wait_readable(nanoseconds until);
  void pass(nanoseconds until) noexcept;
  ssize_t read(void* to, std::size_t size);
  ssize_t write(const void* from, std::size_t size);
  void throw_away();

 private:
  void arrive();

  Peer peer_;
  nanoseconds now_{std::chrono::hours(1)};
  nanoseconds due_{now_};  ///< when the last piece under way arrives
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

/// Frames and control messages for recvmmsg on a CAN socket, which the kernel here may not have.
class VirtualCan {
 public:
  /// Fills one message. @return false when there is none
  using Next = std::function<bool(mmsghdr& message)>;
  explicit VirtualCan(Next next);
  ~VirtualCan();
  VirtualCan(const VirtualCan&) = delete;
  VirtualCan& operator=(const VirtualCan&) = delete;
  Next next;
};

}  // namespace thermocomp::fuzz
