/// Limits of a client's input at the status socket: the length of a line and the rate of requests.
/// Included by this folder's .cpp files only.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace thermocomp {

/// Buffer capacity that an idle client keeps.
inline constexpr std::size_t kept_bytes = 2048;

/// Splits input into lines; holds at most the longest line and one read.
class LineBuffer {
 public:
  static constexpr std::size_t line_bytes_max = std::size_t{64} * 1024;

  void add(std::string_view bytes);
  /// Takes the next line without its end ("\n" or "\r\n").
  /// @return false when no line is complete
  [[nodiscard]] bool take(std::string& line);
  [[nodiscard]] bool has_line() const noexcept { return end_ != std::string::npos; }
  /// True if the first line, complete or not, exceeds line_bytes_max and is never taken.
  [[nodiscard]] bool is_too_long() const noexcept;
  /// True if a line has begun and is incomplete.
  [[nodiscard]] bool is_partial() const noexcept { return !has_line() && begin_ < bytes_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const noexcept { return bytes_.capacity(); }

 private:
  void find_end();

  std::string bytes_;
  std::size_t begin_{0};                ///< of the first line
  std::size_t end_{std::string::npos};  ///< its '\n'
  std::size_t searched_{0};             ///< bytes before this were searched for '\n'
};

inline void LineBuffer::add(std::string_view bytes) {
  bytes_.append(bytes);
  if (!has_line()) find_end();
}

inline bool LineBuffer::take(std::string& line) {
  if (!has_line() || is_too_long()) return false;
  std::size_t length = end_ - begin_;
  if (length > 0 && bytes_[begin_ + length - 1] == '\r') --length;
  line.assign(bytes_, begin_, length);
  begin_ = searched_ = end_ + 1;
  find_end();
  return true;
}

inline bool LineBuffer::is_too_long() const noexcept {
  return (has_line() ? end_ : bytes_.size()) - begin_ > line_bytes_max;
}

/// Finds the next line end; releases unused capacity.
inline void LineBuffer::find_end() {
  end_ = bytes_.find('\n', searched_);
  if (has_line()) return;
  bytes_.erase(0, begin_);
  begin_ = 0;
  searched_ = bytes_.size();
  if (bytes_.empty() && bytes_.capacity() > kept_bytes) bytes_ = std::string();
}

/// Rate limit with bursts: the level l grows by `per_s` up to `burst`; taking one token needs l >=
/// 1. Time is an argument.
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

}  // namespace thermocomp
