/// Sensor choice and equation from measured runs (JP7689460B2), and how far it can be believed.
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
  published,  ///< at most two places of a group, the largest group among them
  free        ///< any places
};

struct FitOptions {
  std::size_t terms_min{3};
  std::size_t terms_max{5};
  Choice choice{Choice::published};
  double threshold{-1.0};  ///< of similarity; negative: chosen
  bool lags{false};
  /// What a reading may be wrong by, each place for itself. Negative: 0 with several tests, whose
  /// left-out errors hold it already (each has a reference of its own); 0.1 K with one run, all
  /// of whose stretches share one.
  double sensor_error_K{-1.0};
  double lag_gain_min{0.05};  ///< share of the left-out sum of squares that a lag must take away
  /// Where groups allow nothing: fewer terms, then any places, each with a warning.
  bool relaxes{false};
  /// Share of its own mean square that each column counts for as error: columns that nearly say the
  /// same then share what is theirs, instead of gains that balance each other. 0: least squares.
  double penalty{0.0};
  std::size_t kept_for_lags{3000};  ///< combinations of each number of terms that get lags
};

/// What the equation says and does for one output.
struct OutputFit {
  Eigen::VectorXd coefficients;  ///< one a column [um/K]
  Eigen::VectorXd ci95;          ///< half width of the 95 % interval
  double train_rms_um{0.0};
  double left_out_rms_um{0.0};
  double left_out_peak_um{0.0};
  double no_model_rms_um{0.0};
  std::vector<double> fold_rms_um;           ///< left out
  std::vector<double> fold_no_model_rms_um;  ///< of the same rows
  double hot_rms_um{0.0};                    ///< of the hot half, from the other; NaN: none
};

/// What is left of the equation when a chosen place is lost.
struct LostPlace {
  std::size_t place{0};
  std::vector<double> without_rms_um;  ///< left out, refitted without it, one an output
  std::size_t replacement{0};  ///< the place that does best in its stead; own: there is none
  std::vector<double> replaced_rms_um;
};

struct Fit {
  Grouping grouping;
  std::vector<std::size_t> places;  ///< chosen, ascending
  std::vector<FitColumn> columns;   ///< their rises, then lags
  std::vector<OutputFit> outputs;
  double condition{0.0};  ///< of the columns, each scaled to length 1
  std::vector<LostPlace> lost;
  /// Left-out prediction over all selected rows of all runs, in order; shape (rows, outputs).
  Eigen::MatrixXd left_out_um;
  std::vector<std::vector<Subset>> ranking;  ///< [terms], best first
  std::uint64_t judged{0};
  std::vector<std::string> warnings;  ///< worse than no model on a test, nearly singular, ...
};

/// The columns of the best equation alone, and its coefficients; shape (columns, outputs).
struct Equation {
  std::vector<FitColumn> columns;
  Eigen::MatrixXd coefficients;
};
/// As fit_equation(), without judging it.
[[nodiscard]] Equation chosen_equation(const MeasuredTests& tests, const FitOptions& options);

/// Every allowed combination; the best by left-out tests (and the hot half of an only run), with
/// what wrong readings would add; of two that are as good (2 %) the one
/// with fewer terms.
/// @throws std::runtime_error when no combination is allowed or there are too many
[[nodiscard]] Fit fit_equation(const MeasuredTests& tests, const FitOptions& options);

/// The model file that the daemon runs; reference: first sample.
[[nodiscard]] ThermalModel model_of(const MeasuredTests& tests, const Fit& fit);

/// Whether a model leaves half or more of what no model leaves of an output, RMS of what was left
/// out.
[[nodiscard]] constexpr bool is_unfit(double left_um, double no_model_um) noexcept {
  return !(left_um < 0.5 * no_model_um);
}

[[nodiscard]] std::string fit_text(const MeasuredTests& tests, const Fit& fit);
[[nodiscard]] std::string fit_json(const MeasuredTests& tests, const Fit& fit);
/// One page with curves of measured and left-out prediction, residuals, and the chosen places.
[[nodiscard]] std::string fit_html(const MeasuredTests& tests, const Fit& fit);

}  // namespace thermocomp::identification
