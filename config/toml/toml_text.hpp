/// TOML as text, for writers of files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace thermocomp {

/// A TOML basic string.
[[nodiscard]] std::string toml_string(std::string_view text);
/// A bare key where that is possible, else a quoted one.
[[nodiscard]] std::string toml_key(std::string_view name);
/// A TOML float: unlike JSON's it needs a point or an exponent to be one.
[[nodiscard]] std::string toml_number(double value);
/// A list of rows, one per line, with the end of the line.
[[nodiscard]] std::string toml_rows(const std::vector<std::vector<double>>& values);

template <class Values, class Show>
[[nodiscard]] std::string toml_list(const Values& values, Show show) {
  std::string text = "[";
  for (const auto& value : values) text.append(text.size() == 1 ? "" : ", ").append(show(value));
  return text + "]";
}

}  // namespace thermocomp
