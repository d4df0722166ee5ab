/// Few sensors with lags, and the heat that operating signals bring beside them.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/equation/fit.hpp"

namespace thermocomp::identification {

/// LP(u^power): missing_heat_source of the model file.
struct HeatColumn {
  std::size_t signal{0};
  double power{1.0};
  double tau_s{0.0};
};

struct HeatEquation {
  std::vector<FitColumn> columns;  ///< 0 < g / K <= 1 for the lags
  std::vector<HeatColumn> heats;
  Eigen::MatrixXd coefficients;  ///< shape (columns, then heats; outputs)
};

/// The column over all rows of a run, less its value at the first row.
[[nodiscard]] Eigen::VectorXd column_of(const TestRun& run, const HeatColumn& column);

/// Forward choice: a signal's heat joins the equation while it takes a twentieth of the left-out
/// sum of squares away and helps on more than half of the folds; at most four.
[[nodiscard]] HeatEquation add_heats(const MeasuredTests& tests, const Equation& equation);

}  // namespace thermocomp::identification
