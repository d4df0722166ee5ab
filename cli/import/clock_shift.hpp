/// The shift of two clocks from what both recordings saw.
#pragma once

#include <optional>
#include <string>

#include "config/run_forms/run_data.hpp"

namespace thermocomp::cli {

struct ClockShift {
  double shift_s{0.0};      ///< the second's time_s plus this is the first's
  double step_s{0.0};       ///< of the grid: the shift is not known better
  double correlation{0.0};  ///< of the changes of the two columns at that shift
  double next{0.0};         ///< the best at another shift
  std::string columns;      ///< "'bed_degC' and 'probe_degC'"
  /// Whether the two follow each other, and at no other shift nearly as well.
  [[nodiscard]] bool is_sure() const noexcept;
};

/// Changes over a step of each column of one are laid beside those of each of the other,
/// r(k) = sum a_i b_(i-k) / sqrt(sum a_i^2 sum b_(i-k)^2), at every shift k that leaves a third of
/// the shorter recording in common; the pair and shift of the greatest |r|.
/// @return nullopt where no column of either moves
[[nodiscard]] std::optional<ClockShift> clock_shift(const RunFile& first, const RunFile& second);

}  // namespace thermocomp::cli
