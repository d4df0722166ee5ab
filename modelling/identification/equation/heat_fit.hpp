/// Few sensors with lags, plus the heat of operating signals.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/equation/fit.hpp"

namespace thermocomp::identification {

/// Factor X - X0 of a gain; X: temperature of a place.
struct StartFactor {
  std::size_t place{0};
  bool at_start{true};  ///< X at the start of the run; else the current X
  double place0_degC{0.0};
};

/// LP(u^power): term missing_heat_source of the model file; with a factor start_dependence, where u
/// may also be the rise of a place.
struct HeatColumn {
  std::size_t signal{0};
  double power{1.0};
  double tau_s{0.0};
  std::optional<StartFactor> factor{};
  std::optional<std::size_t> place{};  ///< u is its rise, not the signal
};

/// True if at least three runs were measured and their start temperatures at a place span 1 K.
[[nodiscard]] bool starts_differ(const MeasuredTests& tests, std::size_t place);

struct HeatEquation {
  std::vector<FitColumn> columns;  ///< 0 < g / K <= 1 for the lags
  std::vector<HeatColumn> heats;
  Eigen::MatrixXd coefficients;  ///< shape (columns + heats, outputs)
};

/// Column over all rows of a run, relative to its first row.
[[nodiscard]] Eigen::VectorXd column_of(const TestRun& run, const HeatColumn& column);

/// Forward selection of at most four columns: a signal's heat, or a gain that depends on a
/// temperature (of a chosen place on its own start, of a signal on the first chosen place's start,
/// of either on the current room: C1, C2 of JP7689460B2). A column joins if it removes a twentieth
/// of the left-out sum of squares and helps on more than half of the folds.
[[nodiscard]] HeatEquation add_heats(const MeasuredTests& tests, const Equation& equation);

}  // namespace thermocomp::identification
