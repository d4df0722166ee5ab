/// Joins recordings with different clocks, and converts operators' corrections to displacements.
#pragma once

#include <optional>
#include <string>

#include "config/run_forms/run_data.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

/// Shift between two clocks, estimated from columns of both recordings.
struct ClockShift {
  double shift_s{0.0};      ///< added to the second's time_s to get the first's
  double step_s{0.0};       ///< grid step, the resolution of the shift
  double correlation{0.0};  ///< of the two columns' changes at this shift
  double next{0.0};         ///< highest correlation at another peak
  double at_expected{0.0};  ///< correlation at the expected shift
  std::string columns;      ///< "'bed_degC' and 'probe_degC'"
  /// The correlation is high, and clearly higher than at any other peak.
  [[nodiscard]] bool is_sure() const noexcept;
};

/// Finds the pair of columns and the shift k with the largest |r|, over all shifts with at least a
/// third of the shorter recording in common. With changes a, b over a fortieth of the shorter one:
///
///     r(k) = sum a_i b_(i-k) / sqrt(A B),  A = (sum_common a_i^2 + sum_all a_i^2) / 2, B likewise
///
/// @return nullopt if no column of either recording changes
[[nodiscard]] std::optional<ClockShift> clock_shift(const RunFile& first, const RunFile& second,
                                                    double expected_s = 0.0);

/// Merges the rows of both files on the first one's clock. In rows only of the second file,
/// temperatures and positions of the first are interpolated, its outputs are empty and its other
/// columns hold their last value, except across gaps longer than a minute and three usual steps.
/// @param shift_s  added to the second's time_s to get the first's; nullopt: from the files' dates,
/// else from columns that change alike
/// @throws ConfigurationError if the shift is unknown or contradicts the dates, or the two do not
/// overlap
[[nodiscard]] RunFile joined_runs(const RunFile& first, const RunFile& second,
                                  std::optional<double> shift_s);

/// Meaning of an entry: an increment, or the total at the controller from then on.
enum class CorrectionEntry { step, total };

/// Whether a column is named like an axis.
[[nodiscard]] bool has_axes(const RunFile& run);

/// displacement = -(sum of the steps until then), or -(total), in um, under the axis' name: an
/// operator who moves a tool by -12 um has measured +12 um. Converts columns named like axes (x,
/// z_mm, A_urad); others are kept.
/// @throws ConfigurationError if no column is named like an axis, or its unit is missing
[[nodiscard]] RunFile displacements_of(RunFile corrections, CorrectionEntry entry);

}  // namespace thermocomp::cli
