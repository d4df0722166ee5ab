/// Few sensors with lags, and the heat that operating signals bring beside them.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/equation/fit.hpp"

namespace thermocomp::identification {

/// X - X0: how far a place is from where the gain is none.
struct StartFactor {
  std::size_t place{0};
  bool at_start{true};  ///< X where the run began, else now
  double place0_degC{0.0};
};

/// LP(u^power): missing_heat_source of the model file; with a factor start_dependence, where u may
/// also be the rise of a place.
struct HeatColumn {
  std::size_t signal{0};
  double power{1.0};
  double tau_s{0.0};
  std::optional<StartFactor> factor{};
  std::optional<std::size_t> place{};  ///< in the signal's place
};

/// Whether three runs or more begin at temperatures of a place that are 1 K apart.
[[nodiscard]] bool starts_differ(const MeasuredTests& tests, std::size_t place);

struct HeatEquation {
  std::vector<FitColumn> columns;  ///< 0 < g / K <= 1 for the lags
  std::vector<HeatColumn> heats;
  Eigen::MatrixXd coefficients;  ///< shape (columns, then heats; outputs)
};

/// The column over all rows of a run, less its value at the first row.
[[nodiscard]] Eigen::VectorXd column_of(const TestRun& run, const HeatColumn& column);

/// Forward choice: a signal's heat, or a gain that depends on how the run began (of a chosen place
/// on itself, of a signal on the first chosen place, of both on the room now: C1, C2 of
/// JP7689460B2), joins the equation while it takes a twentieth of the left-out
/// sum of squares away and helps on more than half of the folds; at most four.
[[nodiscard]] HeatEquation add_heats(const MeasuredTests& tests, const Equation& equation);

}  // namespace thermocomp::identification
