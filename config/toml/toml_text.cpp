#include "config/toml/toml_text.hpp"

#include <algorithm>
#include <cctype>

#include "config/text/printable_text.hpp"

namespace thermocomp {

std::string toml_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      constexpr std::string_view digits = "0123456789ABCDEF";
      const auto code = static_cast<unsigned char>(c);
      result.append("\\u00") += digits[code >> 4u];
      result += digits[code & 15u];
    } else {
      result += c;
    }
  }
  return result + '"';
}

std::string toml_key(std::string_view name) {
  const auto bare = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
  };
  return !name.empty() && std::all_of(name.begin(), name.end(), bare) ? std::string(name)
                                                                      : toml_string(name);
}

std::string toml_number(double value) {
  std::string text = number_text(value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string toml_rows(const std::vector<std::vector<double>>& values) {
  std::string text = "[\n";
  for (const auto& row : values)
    text.append("  ").append(toml_list(row, toml_number)).append(",\n");
  return text + "]\n";
}

}  // namespace thermocomp
