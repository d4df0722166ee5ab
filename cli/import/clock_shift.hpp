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

/// The pair of columns and the shift k of the greatest |r|, among all shifts that leave a third of
/// the shorter recording in common. a and b are the changes of a column of each over a fortieth of
/// the shorter recording,
/// r(k) = sum a_i b_(i-k) / sqrt(A B), A = (sum of a_i^2 in common + sum of all a_i^2) / 2, B
/// alike.
/// @return nullopt where no column of either moves
[[nodiscard]] std::optional<ClockShift> clock_shift(const RunFile& first, const RunFile& second);

}  // namespace thermocomp::cli
