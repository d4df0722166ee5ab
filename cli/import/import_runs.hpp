/// Recordings as one run file: two clocks joined, operators' corrections as displacements.
#pragma once

#include <optional>
#include <string>

#include "config/run_forms/run_data.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

/// The shift of two clocks from what both recordings saw.
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

/// Every row of both by the time of the first. In rows that the second brings along, temperatures
/// and positions of the first are on the line between its rows beside them, its other columns are
/// those of the row before; a gap of more than a minute, or three usual steps, stays empty.
/// @param shift_s  the second's time_s plus this is the first's; nullopt: the dates of both files
///                 tell it or, where they have none, columns that clearly change alike
/// @throws ConfigurationError when the clocks cannot be compared, columns are there twice, or the
///         two do not overlap
[[nodiscard]] RunFile joined_runs(const RunFile& first, const RunFile& second,
                                  std::optional<double> shift_s);

/// Whether an entry is added to those before, or is what stands at the controller from then on.
enum class CorrectionEntry { step, total };

/// displacement = -(sum of the steps until then), or -(total), in um, under the axis' name: an
/// operator who moves a tool by -12 um has found 12 um too much. Of columns called as an axis
/// (x, Y, z_mm, A_urad, ...); others stay.
/// @throws ConfigurationError where no column is an axis', or its unit is not said
[[nodiscard]] RunFile displacements_of(RunFile corrections, CorrectionEntry entry);

}  // namespace thermocomp::cli
