/// Why the daemon does not simply compensate, in plain words, and what to do about it.
#pragma once

#include <string_view>

namespace thermocomp::cli {

struct ReasonText {
  std::string_view name;     ///< as in `reasons` of the method `status`
  std::string_view meaning;  ///< what it is
  std::string_view remedy;   ///< what to do
};

/// @return the text of a reason; an unknown one is shown by its name
[[nodiscard]] ReasonText reason_text(std::string_view name);
/// Of a value that is no number at all: the same words wherever it is seen.
[[nodiscard]] ReasonText nan_text();
/// The same for the fault of a reading.
[[nodiscard]] ReasonText fault_text(std::string_view name);

}  // namespace thermocomp::cli
