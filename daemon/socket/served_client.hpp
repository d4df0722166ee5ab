/// One connection of the status server: socket, buffers, rate limit and state. Only for this
/// folder's .cpp files.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/socket/rpc.hpp"

namespace thermocomp {

/// Splits input into lines; holds at most the longest line and one read.
class LineBuffer {
 public:
  static constexpr std::size_t line_bytes_max = std::size_t{64} * 1024;

  void add(std::string_view bytes);
  /// Takes the next line without its end ("\n" or "\r\n").
  /// @return false when no line is complete
  [[nodiscard]] bool take(std::string& line);
  [[nodiscard]] bool has_line() const noexcept { return end_ != std::string::npos; }
  /// The first line, complete or not, exceeds line_bytes_max: it is never taken.
  [[nodiscard]] bool is_too_long() const noexcept;
  /// A line has begun and is incomplete.
  [[nodiscard]] bool is_partial() const noexcept { return !has_line() && begin_ < bytes_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const noexcept { return bytes_.capacity(); }

 private:
  void find_end();

  std::string bytes_;
  std::size_t begin_{0};                ///< of the first line
  std::size_t end_{std::string::npos};  ///< its '\n'
  std::size_t searched_{0};             ///< bytes before this were searched for '\n'
};

/// Rate limit with bursts: level l grows by `per_s` up to `burst`; taking one needs l >= 1.
/// Time is an argument.
class TokenBucket {
 public:
  using Clock = std::chrono::steady_clock;

  TokenBucket(double per_s, double burst) : per_s_(per_s), burst_(burst), level_(burst) {}

  [[nodiscard]] bool try_take(Clock::time_point now) noexcept {
    refill(now);
    if (!(level_ >= 1.0)) return false;
    level_ -= 1.0;
    return true;
  }
  void give_back() noexcept { level_ += 1.0; }
  /// The earliest time at which a token can be taken.
  [[nodiscard]] Clock::time_point next(Clock::time_point now) noexcept {
    refill(now);
    if (level_ >= 1.0) return now;
    return now + std::chrono::ceil<Clock::duration>(
                     std::chrono::duration<double>((1.0 - level_) / per_s_));
  }

 private:
  void refill(Clock::time_point now) noexcept {
    const double passed_s = std::chrono::duration<double>(now - filled_at_).count();
    filled_at_ = now;
    if (passed_s > 0.0) level_ = std::min(burst_, level_ + per_s_ * passed_s);
  }

  double per_s_;
  double burst_;
  double level_;
  Clock::time_point filled_at_{};
};

struct ServedClient {
  using Clock = std::chrono::steady_clock;

  /// Takes over the descriptor.
  ServedClient(int fd_in, const PeerAccess& access_in, const TokenBucket& tokens_in,
               Clock::time_point now);
  ~ServedClient();
  ServedClient(const ServedClient&) = delete;
  ServedClient& operator=(const ServedClient&) = delete;

  /// One read. May set input_ended or broken.
  void receive(Clock::time_point now);
  /// Sends what the socket accepts, keeps the rest. May set broken.
  void send(std::string_view text, Clock::time_point now);
  void flush(Clock::time_point now);
  [[nodiscard]] bool has_unsent() const noexcept { return sent < output.size(); }
  [[nodiscard]] std::size_t held_bytes() const noexcept {
    return input.capacity_bytes() + output.capacity();
  }
  /// No request, answer or subscription is pending.
  [[nodiscard]] bool is_idle() const noexcept {
    return !subscription && !queued && !has_unsent() && !later;
  }

  int fd;
  PeerAccess access;
  std::int64_t user{-1};  ///< from the kernel; -1: unknown
  TokenBucket tokens;
  LineBuffer input;
  std::string output;
  std::size_t sent{0};  ///< bytes of `output` already sent

  bool input_ended{false};  ///< the peer sends no more; answers may be pending
  bool hung_up{false};      ///< the peer does not read either; received requests are still served
  bool close_when_sent{false};
  bool broken{false};  ///< unusable
  bool ended{false};   ///< to be closed at the end of the turn
  bool queued{false};  ///< waits for its turn or its rate limit
  std::uint32_t watched{0};
  std::size_t counted_bytes{0};  ///< last held_bytes() added to the statistics

  std::function<bool(Answer&)> later;  ///< Answer::later of the request under way
  std::optional<Subscription> subscription;
  Clock::time_point notified_next{};
  std::uint64_t missed{0};  ///< notifications since the last one sent

  Clock::time_point last_request;  ///< or time of connection
  Clock::time_point line_begun;    ///< while input.is_partial()
  Clock::time_point last_taken;    ///< time when the peer took bytes or nothing was pending
};

}  // namespace thermocomp
