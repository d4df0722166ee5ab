/// Values as TOML text, for writers of files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace thermocomp {

/// A TOML basic string.
[[nodiscard]] std::string toml_string(std::string_view text);
/// A bare key if possible, else a quoted one.
[[nodiscard]] std::string toml_key(std::string_view name);
/// A TOML float: unlike in JSON it must have a point or an exponent.
[[nodiscard]] std::string toml_number(double value);
/// A list of rows, one per line, with a final line end.
[[nodiscard]] std::string toml_rows(const std::vector<std::vector<double>>& values);

template <class Values, class Show>
[[nodiscard]] std::string toml_list(const Values& values, Show show) {
  std::string text = "[";
  for (const auto& value : values) text.append(text.size() == 1 ? "" : ", ").append(show(value));
  return text + "]";
}

}  // namespace thermocomp
