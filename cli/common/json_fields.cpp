#include "cli/common/json_fields.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include <nlohmann/json.hpp>

namespace thermocomp::cli {

namespace {

using nlohmann::json;

const json& field(const json& object, const char* key) {
  static const json nothing;
  if (!object.is_object()) return nothing;
  const auto found = object.find(key);
  return found == object.end() ? nothing : *found;
}

std::string formatted(double value, int digits, int width, const char* format) {
  if (!std::isfinite(value)) {
    const std::size_t blanks = width > 1 ? static_cast<std::size_t>(width) - 1 : 0;
    return std::string(blanks, ' ') + "-";
  }
  std::array<char, 400> text{};
  // Clang and GCC cannot see that the format comes from the two callers below.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(text.data(), text.size(), format, width, digits, value);
#pragma GCC diagnostic pop
  return text.data();
}

}  // namespace

double number_of(const json& object, const char* key) {
  const json& value = field(object, key);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::uint64_t count_of(const json& object, const char* key) {
  const double value = number_of(object, key);
  return value >= 0.0 && value < 1.8e19 ? static_cast<std::uint64_t>(value) : 0;
}

std::string text_of(const json& object, const char* key) {
  const json& value = field(object, key);
  std::string text = value.is_string() ? value.get<std::string>() : std::string();
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' '; }, ' ');
  return text;
}

bool flag_of(const json& object, const char* key) {
  const json& value = field(object, key);
  return value.is_boolean() && value.get<bool>();
}

const json& list_of(const json& object, const char* key) {
  static const json none = json::array();
  const json& value = field(object, key);
  return value.is_array() ? value : none;
}

const json& object_of(const json& object, const char* key) {
  static const json none = json::object();
  const json& value = field(object, key);
  return value.is_object() ? value : none;
}

std::string fixed(double value, int digits, int width) {
  return formatted(value, digits, width, "%*.*f");
}

std::string fixed_signed(double value, int digits, int width) {
  // What is shown as zero has no sign to tell.
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

}  // namespace thermocomp::cli
