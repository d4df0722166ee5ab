// SPDX-License-Identifier: GPL-2.0-or-later
/// The two lines of an exchange with the daemon: JSON-RPC `controller_state` and its answer.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "linuxcnc/machine_view.hpp"

namespace thermocomp_linuxcnc {

/// An answer that must not be acted on.
class BadAnswer : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Answer {
  bool anew{false};                              ///< offsets go on from what was reported
  std::string mode;                              ///< of the daemon: "compensating", "holding", ...
  std::vector<std::optional<double>> offset_mm;  ///< order of the axes; none: leave it as it is
};

/// @param axes  letters; view.axes is in their order
/// @return with its line's end. Values that are not finite become null
[[nodiscard]] std::string request_line(std::uint64_t session, std::uint64_t id,
                                       std::string_view axes, const MachineView& view);

/// @param offset_mm_max  a larger offset is no offset
/// @throws BadAnswer: not JSON, of another request, an error, an axis left out, a value that
///         cannot be
[[nodiscard]] Answer read_answer(std::string_view line, std::uint64_t id, std::string_view axes,
                                 double offset_mm_max);

}  // namespace thermocomp_linuxcnc
