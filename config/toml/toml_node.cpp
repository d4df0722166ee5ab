#include "config/toml/toml_node.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "config/text/printable_text.hpp"

namespace thermocomp::detail {
namespace {

constexpr std::size_t shown_value_max = 60;

/// Appends the value in TOML syntax on one line, up to the length limit.
void append_shown(const toml::node& node, std::string& out) {
  if (out.size() > shown_value_max) return;
  if (const auto* text = node.as_string()) {
    out.append("\"").append(text->get()).append("\"");
  } else if (const auto* number = node.as_floating_point()) {
    out += number_text(number->get());
  } else if (const auto* list = node.as_array()) {
    out += '[';
    for (const toml::node& element : *list) {
      if (out.back() != '[') out += ", ";
      append_shown(element, out);
    }
    out += ']';
  } else if (const auto* table = node.as_table()) {
    out += '{';
    for (const auto& [key, value] : *table) {
      out.append(out.back() == '{' ? " " : ", ").append(key.str()).append(" = ");
      append_shown(value, out);
    }
    out += " }";
  } else {
    std::ostringstream other;
    node.visit([&](const auto& value) { other << value; });
    out += other.str();
  }
}

}  // namespace

int line_of(const toml::source_region& source) {
  return static_cast<int>(source.begin.line);
}

std::string shortened(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  if (text.size() <= shown_value_max) return text;
  std::size_t end = shown_value_max - 4;
  const auto continues = [&](std::size_t i) {  // inside a UTF-8 sequence
    return (static_cast<unsigned char>(text[i]) & 0xC0u) == 0x80u;
  };
  while (end > 0 && continues(end)) --end;
  return text.substr(0, end) + " ...";
}

std::string shown(const toml::node& node) {
  std::string text;
  append_shown(node, text);
  return shortened(text);
}

std::string at_position(std::size_t position, std::string_view rule) {
  return "element " + std::to_string(position) + " " + std::string(rule);
}

double harmless(const Range& range) {
  if (range.contains(0.0)) return 0.0;
  if (!range.min_excluded) return range.min;
  if (range.contains(range.min + 1.0)) return range.min + 1.0;
  return range.max;
}

std::optional<double> number_in(const toml::node& node, const Range& range, std::string& rule) {
  if (!node.is_number()) {
    rule = "must be a number";
    return std::nullopt;
  }
  const auto* integer = node.as_integer();
  const double value =
      integer != nullptr ? static_cast<double>(integer->get()) : node.as_floating_point()->get();
  if (range.contains(value)) return value;
  rule = std::isfinite(value) ? range.rule() : "must be a finite number";
  return std::nullopt;
}

std::optional<std::int64_t> integer_in(const toml::node& node, std::int64_t low, std::int64_t high,
                                       std::string& rule) {
  rule = "must be a whole number in [" + std::to_string(low) + ", " + std::to_string(high) + "]";
  const auto* integer = node.as_integer();
  if (integer == nullptr || integer->get() < low || integer->get() > high) return std::nullopt;
  return integer->get();
}

}  // namespace thermocomp::detail
