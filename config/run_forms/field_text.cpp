#include "config/run_forms/field_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "estimator/types.hpp"

namespace thermocomp {

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

bool is_missing(std::string_view field) {
  return field.empty() || field == "nan" || field == "NaN" || field == "NAN";
}

std::optional<double> finite_number(std::string_view field) {
  if (field.size() > 1 && field.front() == '+' && field[1] != '-') field.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc{} || end != field.data() + field.size()) return std::nullopt;
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

bool take(std::string_view& rest, char separator, std::string_view& part) {
  if (rest.data() == nullptr) return false;
  const auto end = rest.find(separator);
  part = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  return true;
}

std::string_view take_line(std::string_view& text) {
  std::string_view line;
  if (take(text, '\n', line))
    while (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::string small_letters(std::string_view text) {
  std::string small(text);
  for (char& c : small) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return small;
}

bool is_one_of(std::string_view words, std::string_view text) {
  return text.find('|') == std::string_view::npos &&
         words.find('|' + small_letters(text) + '|') != std::string_view::npos;
}

std::optional<double> switch_word(std::string_view field) {
  for (const std::string_view on : {"on", "ON", "On", "true", "TRUE", "True"})
    if (field == on) return 1.0;
  for (const std::string_view off : {"off", "OFF", "Off", "false", "FALSE", "False"})
    if (field == off) return 0.0;
  return std::nullopt;
}

std::string shortened(std::string_view text) {
  constexpr std::size_t shown_max = 40;
  if (text.size() <= shown_max) return std::string(text);
  std::size_t end = shown_max;
  const auto within_letter = [&] { return (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80; };
  while (end > 0 && within_letter()) --end;
  return std::string(text.substr(0, end)) + " ...";
}

std::string toml_text(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '\\' || c == '"') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace thermocomp
