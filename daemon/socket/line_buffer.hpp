/// Bytes in, lines out; never holds more than the longest line and one read.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace thermocomp {

class LineBuffer {
 public:
  static constexpr std::size_t line_bytes_max = std::size_t{64} * 1024;

  void add(std::string_view bytes);
  /// The next line without its end ("\n" or "\r\n").
  /// @return false when there is no whole line
  [[nodiscard]] bool take(std::string& line);
  [[nodiscard]] bool has_line() const noexcept { return end_ != std::string::npos; }
  /// The line at the front, whole or not, has more than line_bytes_max: nothing is taken any more.
  [[nodiscard]] bool is_too_long() const noexcept;
  /// A line has begun and is not whole.
  [[nodiscard]] bool is_partial() const noexcept { return !has_line() && begin_ < bytes_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const noexcept { return bytes_.capacity(); }

 private:
  void find_end();

  std::string bytes_;
  std::size_t begin_{0};                ///< of the line at the front
  std::size_t end_{std::string::npos};  ///< its '\n'
  std::size_t searched_{0};             ///< before this there is no '\n' of it
};

}  // namespace thermocomp
