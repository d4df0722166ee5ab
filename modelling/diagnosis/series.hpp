/// Columns of a run through filters, shifted, and their slopes.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/measured_runs.hpp"
#include "modelling/diagnosis/panel.hpp"

namespace thermocomp::diagnosis {

/// Each column through LowPass of its own tau_s.
void lag_each(const Column& time_s, const std::vector<double>& taus_s, Panel& columns);

/// The column through LowPass filters, one of each tau_s, shape (rows, taus).
[[nodiscard]] Panel lagged(const Column& time_s, const Column& values,
                           const std::vector<double>& taus_s);

/// The column through Play of each width, shape (rows, widths).
[[nodiscard]] Panel played(const Column& values, const std::vector<double>& widths);

/// Sine and cosine of 2 pi t / period, each of shape (rows, periods).
struct Waves {
  Panel sines;
  Panel cosines;
};
[[nodiscard]] Waves waves(const Column& time_s, const std::vector<double>& periods_s);

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with each tau_s, which shifts nothing; shape (rows, taus).
[[nodiscard]] Panel smoothed(const Column& time_s, const Column& values,
                             const std::vector<double>& taus_s);

/// The values smoothed forwards and backwards over as many rows (0, 1, 2, 4 or 8) as predict a row
/// left out best: the noise of single values goes, what the values do stays.
[[nodiscard]] Column calm(const Column& time_s, const Column& values);

/// The derivative of the values smoothed forwards and backwards with each tau_s, shape (rows,
/// taus).
[[nodiscard]] Panel slopes_per_s(const Column& time_s, const Column& values,
                                 const std::vector<double>& taus_s);

}  // namespace thermocomp::diagnosis
