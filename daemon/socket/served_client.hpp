/// One connection of the status server: its socket, its buffers, where it stands. Only for this
/// folder's .cpp files.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "daemon/socket/line_buffer.hpp"
#include "daemon/socket/rpc_dispatcher.hpp"
#include "daemon/socket/token_bucket.hpp"

namespace thermocomp {

struct ServedClient {
  using Clock = std::chrono::steady_clock;

  /// Takes over the descriptor.
  ServedClient(int fd_in, const PeerAccess& access_in, const TokenBucket& tokens_in,
               Clock::time_point now);
  ~ServedClient();
  ServedClient(const ServedClient&) = delete;
  ServedClient& operator=(const ServedClient&) = delete;

  /// One read. Afterwards input_ended or broken may be set.
  void receive(Clock::time_point now);
  /// Sends what the socket takes, keeps the rest. Afterwards broken may be set.
  void send(std::string_view text, Clock::time_point now);
  void flush(Clock::time_point now);
  [[nodiscard]] bool owes() const noexcept { return sent < output.size(); }
  [[nodiscard]] std::size_t held_bytes() const noexcept {
    return input.capacity_bytes() + output.capacity();
  }
  /// Nothing is under way: neither request nor answer nor subscription.
  [[nodiscard]] bool is_idle() const noexcept {
    return !subscription && !queued && !owes() && !later;
  }

  int fd;
  PeerAccess access;
  std::int64_t user{-1};  ///< as the kernel noted it; -1: it does not tell
  TokenBucket tokens;
  LineBuffer input;
  std::string output;
  std::size_t sent{0};  ///< bytes at the front of `output` that are already sent

  bool input_ended{false};  ///< the peer sends no more; answers may still be owed
  bool hung_up{false};      ///< nor does it read any more; what it has sent still counts
  bool close_when_sent{false};
  bool broken{false};  ///< nothing can be done with it any more
  bool ended{false};   ///< noted to be closed at the end of the turn
  bool queued{false};  ///< waits for its turn or for its rate
  std::uint32_t watched{0};
  std::size_t counted_bytes{0};  ///< of held_bytes(), as last added up

  std::function<bool(Answer&)> later;  ///< Answer::later of its request that is under way
  std::optional<Subscription> subscription;
  Clock::time_point notified_next{};
  std::uint64_t missed{0};  ///< notifications since the last that was sent

  Clock::time_point last_request;  ///< or when it connected
  Clock::time_point line_begun;    ///< while input.is_partial()
  Clock::time_point last_taken;    ///< the peer took bytes, or there was nothing to take
};

}  // namespace thermocomp
