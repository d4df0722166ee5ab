/// Names to indices, once, when something is built.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/checks.hpp"

namespace thermocomp {

/// @return where `name` stands in `names`
/// @throws InvalidValue with `key` and `rule` when it does not
[[nodiscard]] inline std::size_t index_of(const std::vector<std::string>& names,
                                          const std::string& name, const char* key,
                                          const char* rule) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InvalidValue(key, name, rule);
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace thermocomp
