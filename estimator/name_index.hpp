/// Mapping of names to indices, done once at construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "estimator/checks.hpp"

namespace thermocomp {

/// @return the index of `name` in `names`
/// @throws InvalidValue with `key` and `rule` if it is missing
[[nodiscard]] inline std::size_t index_of(const std::vector<std::string>& names,
                                          const std::string& name, const char* key,
                                          const char* rule) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InvalidValue(key, name, rule);
  return static_cast<std::size_t>(found - names.begin());
}

/// Index of each of our names among theirs; -1: missing.
[[nodiscard]] inline std::vector<int> plan_names(const std::vector<std::string>& ours,
                                                 const std::vector<std::string>& theirs) {
  std::vector<int> plan;
  for (const std::string& name : ours) {
    const auto found = std::find(theirs.begin(), theirs.end(), name);
    plan.push_back(found == theirs.end() ? -1 : static_cast<int>(found - theirs.begin()));
  }
  return plan;
}

/// Replaces our values by theirs of the same name.
template <class T>
void take_by_plan(const std::vector<int>& plan, const std::vector<T>& from,
                  std::vector<T>& to) noexcept {
  for (std::size_t i = 0; i < plan.size(); ++i)
    if (plan[i] >= 0) to[i] = from[static_cast<std::size_t>(plan[i])];
}

/// Takes the value of the name if it is finite.
inline void take_if_finite(const std::map<std::string, double>& from, const std::string& name,
                           double& to) {
  const auto found = from.find(name);
  if (found != from.end() && std::isfinite(found->second)) to = found->second;
}

}  // namespace thermocomp
