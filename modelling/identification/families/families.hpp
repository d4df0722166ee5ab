/// Comparison of model families, from no model to a bank of lags, by left-out error.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "estimator/thermal_model.hpp"
#include "modelling/identification/equation/fit.hpp"

namespace thermocomp::identification {

/// From the simplest to the most complex.
enum class Family { none, static_few, lagged_few, physical, lag_bank };
inline constexpr std::array<Family, 5> all_families{
    Family::none, Family::static_few, Family::lagged_few, Family::physical, Family::lag_bank};
/// Least reduction of the left-out RMS relative to no model. With it, pure noise got a model in
/// none of 60 sets of four to seven simulated runs, and in three of 30 sets with noise that wanders
/// for hours.
inline constexpr double less_than_none = 0.1;
inline constexpr const char* as_requested = "as requested";  ///< `chosen_because` of a given family
[[nodiscard]] std::string_view to_string(Family family) noexcept;
[[nodiscard]] std::optional<Family> family_of(std::string_view name);

/// Result of a family on left-out folds; its choices (places, lags) were repeated on the other
/// folds.
struct FamilyResult {
  Family family{Family::none};
  bool answers{false};
  std::string why_not;
  Eigen::MatrixXd left_out_um;               ///< prediction; shape (rows of the folds, outputs)
  std::vector<double> left_out_rms_um;       ///< one per output
  std::vector<std::vector<double>> fold_um;  ///< RMS, shape (outputs, folds)
  std::vector<double> scores;  ///< squares per fold, relative to no model on all folds
};

struct FamiliesFit {
  std::vector<FamilyResult> results;  ///< order of all_families
  Family chosen{Family::none};
  FamilyResult of_model;  ///< that of the chosen; of no model for outputs without gains
  std::vector<std::size_t> without_gains;  ///< outputs that the chosen family does not predict
  std::vector<double> other_half_um;  ///< RMS on the halves of a single run by models of the other
  std::string chosen_because;         ///< one line with the decisive figures
  std::vector<std::vector<std::string>> together;  ///< places that always moved alike
  std::vector<std::string> unmoved;                ///< signals without a gain
  ThermalModel model;      ///< of the chosen family, on all rows, with [made_from]
  std::optional<Fit> few;  ///< of static_few and lagged_few
  std::vector<std::string> warnings;
};

/// Judges none, static_few and lag_bank on left-out runs; two or three runs also on stretches, a
/// single one on stretches and halves. A family worse than no model in any judgement is excluded.
/// The bank is chosen unless its error exceeds that of few sensors by a tenth, and no model unless
/// a family leaves a tenth less. An output that the chosen family does not predict gets no gains.
/// lagged_few and physical are judged only if forced. Gradual signals get gains in the bank if it
/// leaves a tenth less with them in every judgement.
/// @param forced    family in place of the chosen one
/// @param progress  called with the completed share of the work
/// @throws std::runtime_error if the forced family has no answer
[[nodiscard]] FamiliesFit fit_families(const MeasuredTests& tests, const FitOptions& options,
                                       std::optional<Family> forced,
                                       const std::function<void(double)>& progress);

/// Adds what the runs cannot show, and outputs and runs for which the model is not fit for use.
void add_warnings(const MeasuredTests& tests, FamiliesFit& fit);

/// The halves of the only run as folds, since a model is used after its record.
[[nodiscard]] MeasuredTests in_halves(const MeasuredTests& tests);

/// RMS of measured minus predicted over the folds, one per output of the model. Places and signals
/// that `tests` left out count as constant.
/// @pre the model has the outputs of `tests`
[[nodiscard]] std::vector<double> remainders_um(const MeasuredTests& tests,
                                                const ThermalModel& model);

/// Ranges, covariance and left-out errors of `fit.model`, without its own `made_from`.
[[nodiscard]] MadeFrom made_from_tests(const MeasuredTests& tests, const FamiliesFit& fit);

/// `fitted` with all inputs and outputs of `frame`, in its order, then its own, so that the
/// daemon's blocks and axes need no change: a place that the fit does not use has the coefficient
/// 0; an output that was not fitted keeps its row. Terms and `[made_from]` are those of `fitted`.
/// @param notes  receives outputs that are kept or new, and what is not taken over
/// @throws std::runtime_error if `frame` has terms, guideways or a course and an output that was
/// not fitted, which would lose them
[[nodiscard]] ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame,
                                    std::vector<std::string>& notes);

/// All families, and details of the chosen one.
[[nodiscard]] std::string families_text(const MeasuredTests& tests, const FamiliesFit& fit);
/// HTML page: table, curves of measured and left-out prediction, and the warnings.
[[nodiscard]] std::string families_html(const MeasuredTests& tests, const FamiliesFit& fit);
/// fit_json() if the chosen model is an equation of few sensors, with "families" and "family".
[[nodiscard]] std::string families_json(const MeasuredTests& tests, const FamiliesFit& fit);

}  // namespace thermocomp::identification
