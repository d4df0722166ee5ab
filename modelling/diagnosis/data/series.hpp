/// Columns of a run through filters, shifted, and their slopes.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/panel.hpp"

namespace thermocomp::diagnosis {

/// Each column through LowPass of its own tau_s, in place.
void lag_each(const Column& time_s, const std::vector<double>& taus_s, PanelPart columns);

/// The series through LowPass filters, one of each tau_s, shape (rows, taus).
void lagged(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
            PanelPart into);
/// The same, the series taken off.
void lagged_less_values(const Column& time_s, const Column& values,
                        const std::vector<double>& taus_s, PanelPart into);

/// The series through Play of each width, the series taken off, each row times its factor; shape
/// (rows, widths).
void played_less_values(const Column& values, const std::vector<double>& widths,
                        const Column& factors, PanelPart into);

/// Sine and cosine of 2 pi t / period as neighbours, those of a period `apart` columns after those
/// of the one before.
void waves(const Column& time_s, const std::vector<double>& periods_s, Eigen::Index apart,
           PanelPart into);

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with each tau_s, which shifts nothing; shape (rows, taus).
void smoothed(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
              PanelPart into);

/// The values smoothed forwards and backwards over as many rows (0, 1, 2, 4 or 8) as predict a row
/// left out best: the noise of single values goes, what the values do stays.
[[nodiscard]] Column calm(const Column& time_s, const Column& values);

/// The derivative [1/s] of the values smoothed forwards and backwards with each tau_s, times the
/// factors of row and column; shape (rows, taus).
void slopes(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
            const Column& of_rows, const std::vector<double>& of_columns, PanelPart into);

}  // namespace thermocomp::diagnosis
