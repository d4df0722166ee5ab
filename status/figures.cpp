#include "status/figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>

namespace thermocomp {

namespace {

std::string formatted(double value, int digits, int width, const char* format) {
  if (!std::isfinite(value)) {
    const std::size_t blanks = width > 1 ? static_cast<std::size_t>(width) - 1 : 0;
    return std::string(blanks, ' ') + "-";
  }
  std::array<char, 400> text{};
  // Clang and GCC cannot see the formats of the two callers below.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(text.data(), text.size(), format, width, digits, value);
#pragma GCC diagnostic pop
  return text.data();
}

}  // namespace

std::string fixed(double value, int digits, int width) {
  return formatted(value, digits, width, "%*.*f");
}

std::string fixed_signed(double value, int digits, int width) {
  // A value rounded to zero has no sign.
  if (std::abs(value) < 0.5 * std::pow(10.0, -digits)) value = 0.0;
  return formatted(value, digits, width, "%+*.*f");
}

std::string padded(const std::string& text, int width) {
  const auto is_start = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; };
  const auto characters = std::count_if(text.begin(), text.end(), is_start);
  const auto missing = std::max<std::ptrdiff_t>(0, width - characters);
  return text + std::string(static_cast<std::size_t>(missing), ' ');
}

std::string duration_text(double seconds) {
  if (!(seconds >= 0.0 && seconds < 1e12)) return "-";
  const auto total_s = static_cast<std::int64_t>(seconds);
  const auto parts = [](std::int64_t large, const char* a, std::int64_t small, const char* b) {
    return std::to_string(large) + a + std::to_string(small) + b;
  };
  if (total_s < 60) return std::to_string(total_s) + " s";
  if (total_s < 3600) return parts(total_s / 60, " min ", total_s % 60, " s");
  if (total_s < 86400) return parts(total_s / 3600, " h ", total_s % 3600 / 60, " min");
  return parts(total_s / 86400, " d ", total_s % 86400 / 3600, " h");
}

std::string local_time(double wall_s) {
  if (!(wall_s >= 0.0 && wall_s < 1e11)) return "-";
  const auto seconds = static_cast<std::time_t>(wall_s);
  std::tm parts{};
  localtime_r(&seconds, &parts);
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &parts);
  const auto tenths = static_cast<int>(10.0 * (wall_s - std::floor(wall_s)));
  return std::string(text.data()) + "." + std::to_string(tenths);
}

std::string joined(const std::vector<std::string>& words) {
  std::string result;
  for (const std::string& word : words) result += (result.empty() ? "" : ", ") + word;
  return result;
}

}  // namespace thermocomp
