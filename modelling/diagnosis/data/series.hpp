/// Columns, alone and side by side, through filters, shifted, and their slopes.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace thermocomp::diagnosis {

using Column = Eigen::VectorXd;

/// The values of a row lie next to each other: what goes from row to row does all columns at once.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The series through the estimator's LowPass of each tau_s, shape (rows, taus).
[[nodiscard]] Panel lagged(const Column& time_s, const Column& values,
                           const std::vector<double>& taus_s);
[[nodiscard]] Column lagged(const Column& time_s, const Column& values, double tau_s);

/// The series through the estimator's Play of each width, the series taken off, shape (rows,
/// widths).
[[nodiscard]] Panel played_less_values(const Column& values, const std::vector<double>& widths);

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with tau_s, which shifts nothing.
[[nodiscard]] Column smoothed(const Column& time_s, const Column& values, double tau_s);

/// The values smoothed forwards and backwards over as many rows (0, 1, 2, 4 or 8) as predict a row
/// left out best: the noise of single values goes, what the values do stays.
[[nodiscard]] Column denoised(const Column& time_s, const Column& values);

/// The derivative [1/s] of the values smoothed with tau_s.
[[nodiscard]] Column slope(const Column& time_s, const Column& values, double tau_s);

/// `count` values from low to high, each the same factor after the one before, or the same step.
[[nodiscard]] std::vector<double> logarithmic_grid(double low, double high, std::size_t count);
[[nodiscard]] std::vector<double> linear_grid(double low, double high, std::size_t count);

}  // namespace thermocomp::diagnosis
