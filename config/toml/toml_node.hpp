/// Nodes of a document: shared state of its tables, positions, display, and numbers with a range.
/// Only for the files of this folder, which hides the parser library.
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

/// Number of problems kept; the first hundred are reported.
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

/// Reduces the text to one line of the length shown in a problem.
[[nodiscard]] std::string shortened(std::string text);
/// The value in TOML syntax, shortened.
[[nodiscard]] std::string shown(const toml::node& node);
/// "element 3 must be ..."
[[nodiscard]] std::string at_position(std::size_t position, std::string_view rule);

/// A number inside the range, to continue reading after a problem.
[[nodiscard]] double harmless(const Range& range);
/// @return the number; none, with `rule` set, after a problem
[[nodiscard]] std::optional<double> number_in(const toml::node& node, const Range& range,
                                              std::string& rule);
[[nodiscard]] std::optional<std::int64_t> integer_in(const toml::node& node, std::int64_t low,
                                                     std::int64_t high, std::string& rule);

}  // namespace thermocomp::detail
