/// What the tables of one document share. Only for the files of this folder.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <toml++/toml.h>

#include "config/text/problems.hpp"

namespace thermocomp::detail {

/// Of these the first hundred are told; what comes after so many is not looked for.
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

}  // namespace thermocomp::detail
