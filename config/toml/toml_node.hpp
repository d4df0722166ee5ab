/// One document's values: what its tables share, where each stands, how it is shown to a person,
/// and as a number that keeps a rule. Only for the files of this folder: nobody else sees the
/// library that parses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <toml++/toml.h>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::detail {

/// The reader keeps so many problems and reports the first hundred; it looks for no more.
inline constexpr std::size_t kept_problems_max = 10'000;

struct TomlState {
  std::string name;
  std::string text;
  toml::table root;
  std::vector<Problem> problems;
  struct Opened {
    std::string path;
    std::set<std::string, std::less<>> asked;
    bool ignore_rest{false};
  };
  std::map<const toml::table*, Opened> opened;

  void add(int line, std::string key, std::string value, std::string_view rule) {
    if (problems.size() >= kept_problems_max) return;
    problems.push_back({name, line, std::move(key), std::move(value), std::string(rule)});
  }
};

[[nodiscard]] inline const toml::table* as_table(const void* node) {
  return static_cast<const toml::table*>(node);
}
[[nodiscard]] inline const toml::node* as_node(const void* node) {
  return static_cast<const toml::node*>(node);
}

[[nodiscard]] int line_of(const toml::source_region& source);

/// On one line, and not longer than a problem shows.
[[nodiscard]] std::string shortened(std::string text);
/// The value as a person would write it, shortened.
[[nodiscard]] std::string shown(const toml::node& node);
/// "element 3 must be ..."
[[nodiscard]] std::string at_position(std::size_t position, std::string_view rule);

/// A number inside the range, for reading on after a problem.
[[nodiscard]] double harmless(const Range& range);
/// @return the number, or a problem's rule
[[nodiscard]] std::optional<double> number_in(const toml::node& node, const Range& range,
                                              std::string& rule);
[[nodiscard]] std::optional<std::int64_t> integer_in(const toml::node& node, std::int64_t low,
                                                     std::int64_t high, std::string& rule);

}  // namespace thermocomp::detail
