/// When the reference was taken, and by whom: for people, nothing is computed from it.
#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>

#include "estimator/types.hpp"

namespace thermocomp {

enum class ReferenceOrigin : std::uint8_t {
  unknown,       ///< of a state file that does not say, or of the history
  first_values,  ///< the first good values of a start, or of inputs that came new
  command,       ///< an operator's `reference`
  reload         ///< a configuration or model that was taken over
};
/// As it stands in JSON: "operator", "first_values", "reload"; empty: unknown.
[[nodiscard]] constexpr std::string_view to_string(ReferenceOrigin origin) noexcept {
  switch (origin) {
    case ReferenceOrigin::command:
      return "operator";
    case ReferenceOrigin::first_values:
      return "first_values";
    case ReferenceOrigin::reload:
      return "reload";
    case ReferenceOrigin::unknown:
      break;
  }
  return "";
}

struct ReferenceRecord {
  double wall_s{not_a_number};  ///< seconds since 1970, as the clock stood then; NaN: not known
  ReferenceOrigin origin{ReferenceOrigin::unknown};
  [[nodiscard]] bool is_known() const noexcept {
    return std::isfinite(wall_s) && origin != ReferenceOrigin::unknown;
  }
};

}  // namespace thermocomp
