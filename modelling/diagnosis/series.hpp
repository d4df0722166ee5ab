/// Columns of a run through filters, shifted, and their slopes.
#pragma once

#include <chrono>

#include <Eigen/Core>

#include "estimator/types.hpp"
#include "modelling/diagnosis/measured_runs.hpp"

namespace thermocomp::diagnosis {

inline nanoseconds at_time(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

/// The column through one of the estimator's filters.
template <class Filter>
Column through(Filter filter, const Column& time_s, const Column& input) {
  Column out(input.size());
  for (Eigen::Index row = 0; row < input.size(); ++row) {
    if constexpr (requires { filter.step(nanoseconds{}, 0.0); })
      out[row] = filter.step(at_time(time_s[row]), input[row]);
    else
      out[row] = filter.step(input[row]);
  }
  return out;
}

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with tau_s, which shifts nothing.
[[nodiscard]] Column smoothed(const Column& time_s, const Column& values, double tau_s);

/// The values smoothed forwards and backwards over as many rows (0, 1, 2, 4 or 8) as predict a row
/// left out best: the noise of single values goes, what the values do stays.
[[nodiscard]] Column calm(const Column& time_s, const Column& values);

/// The derivative of the values smoothed forwards and backwards with tau_s.
[[nodiscard]] Column slope_per_s(const Column& time_s, const Column& values, double tau_s);

}  // namespace thermocomp::diagnosis
