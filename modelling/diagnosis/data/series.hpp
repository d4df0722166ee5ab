/// Filters, shifts and slopes of columns.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace thermocomp::diagnosis {

using Column = Eigen::VectorXd;

/// Row-major, since filters process all columns of a row at once.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The series filtered by the estimator's LowPass with each tau_s, shape (rows, taus).
[[nodiscard]] Panel lagged(const Column& time_s, const Column& values,
                           const std::vector<double>& taus_s);
[[nodiscard]] Column lagged(const Column& time_s, const Column& values, double tau_s);

/// Output of the estimator's Play with each width, minus the series; shape (rows, widths).
[[nodiscard]] Panel played_less_values(const Column& values, const std::vector<double>& widths);

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with tau_s, without a phase shift.
[[nodiscard]] Column smoothed(const Column& time_s, const Column& values, double tau_s);

/// The values smoothed forwards and backwards over 0, 1, 2, 4 or 8 rows, whichever predicts a
/// left-out row best: it removes the noise of single values.
[[nodiscard]] Column denoised(const Column& time_s, const Column& values);

/// The derivative [1/s] of the values smoothed with tau_s.
[[nodiscard]] Column slope(const Column& time_s, const Column& values, double tau_s);

/// `count` values from low to high with a constant ratio, or with a constant step.
[[nodiscard]] std::vector<double> logarithmic_grid(double low, double high, std::size_t count);
[[nodiscard]] std::vector<double> linear_grid(double low, double high, std::size_t count);

}  // namespace thermocomp::diagnosis
