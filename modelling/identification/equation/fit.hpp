/// Sensor choice and equation from measured runs (JP7689460B2), with left-out errors and confidence
/// intervals.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "estimator/thermal_model.hpp"
#include "modelling/identification/equation/lag_search.hpp"
#include "modelling/identification/equation/similarity.hpp"
#include "modelling/identification/equation/subset_search.hpp"

namespace thermocomp::identification {

enum class Choice {
  published,  ///< at most two places per group, at least one of the largest
  free        ///< any places
};

struct FitOptions {
  std::size_t terms_min{3};
  std::size_t terms_max{5};
  Choice choice{Choice::published};
  double threshold{-1.0};  ///< of similarity; negative: automatic
  bool lags{false};
  /// Error of each place's reading, independent of the others. Negative: 0 with several tests,
  /// whose left-out errors include it (each has its own reference); 0.1 K with one run, whose
  /// stretches share one reference.
  double sensor_error_K{-1.0};
  double lag_gain_min{0.05};  ///< least share of the left-out sum of squares that a lag removes
  /// If the groups allow no combination: fewer terms, then any places, each with a warning.
  bool relaxes{false};
  /// Ridge penalty of each column, as a share of its mean square: nearly collinear columns share
  /// their effect instead of having gains that cancel each other. 0: least squares.
  double penalty{0.0};
  std::size_t kept_for_lags{3000};  ///< combinations per number of terms that are tried with lags
};

/// Equation and errors of one output.
struct OutputFit {
  Eigen::VectorXd coefficients;  ///< one per column [um/K]
  Eigen::VectorXd ci95;          ///< half width of the 95 % interval
  double train_rms_um{0.0};
  double left_out_rms_um{0.0};
  double left_out_peak_um{0.0};
  double no_model_rms_um{0.0};
  std::vector<double> fold_rms_um;           ///< on the left-out fold
  std::vector<double> fold_no_model_rms_um;  ///< on the same rows
  double hot_rms_um{0.0};                    ///< on the hot half, fitted to the other; NaN: none
};

/// Errors after the loss of a chosen place.
struct LostPlace {
  std::size_t place{0};
  std::vector<double> without_rms_um;  ///< left out, refitted without the place, by output
  std::size_t replacement{0};          ///< best substitute; the place itself: none
  std::vector<double> replaced_rms_um;
};

struct Fit {
  Grouping grouping;
  std::vector<std::size_t> places;  ///< chosen, ascending
  std::vector<FitColumn> columns;   ///< their rises, then lags
  std::vector<OutputFit> outputs;
  double condition{0.0};  ///< of the columns, each scaled to length 1
  std::vector<LostPlace> lost;
  /// Left-out prediction of all selected rows, in order of the runs; shape (rows, outputs).
  Eigen::MatrixXd left_out_um;
  std::vector<std::vector<Subset>> ranking;  ///< [terms], best first
  std::uint64_t judged{0};
  std::vector<std::string> warnings;  ///< worse than no model on a test, nearly singular, ...
};

/// Columns and coefficients of the best equation; shape (columns, outputs).
struct Equation {
  std::vector<FitColumn> columns;
  Eigen::MatrixXd coefficients;
};
/// The choice of fit_equation() without its evaluation.
[[nodiscard]] Equation chosen_equation(const MeasuredTests& tests, const FitOptions& options);

/// Searches all allowed combinations for the smallest left-out error (including the hot half of a
/// single run) plus the effect of reading errors; within 2 % the one with fewer terms is chosen.
/// @throws std::runtime_error if no combination is allowed or there are too many
[[nodiscard]] Fit fit_equation(const MeasuredTests& tests, const FitOptions& options);

/// The model file that the daemon runs; reference: first sample.
[[nodiscard]] ThermalModel model_of(const MeasuredTests& tests, const Fit& fit);

/// True if the left-out RMS is not below half of that without a model.
[[nodiscard]] constexpr bool is_unfit(double left_um, double no_model_um) noexcept {
  return !(left_um < 0.5 * no_model_um);
}

[[nodiscard]] std::string fit_text(const MeasuredTests& tests, const Fit& fit);
[[nodiscard]] std::string fit_json(const MeasuredTests& tests, const Fit& fit);
/// HTML page: curves of measured and left-out prediction, residuals, and the chosen places.
[[nodiscard]] std::string fit_html(const MeasuredTests& tests, const Fit& fit);

}  // namespace thermocomp::identification
