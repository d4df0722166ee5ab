/// Models of several kinds side by side, from nothing to a bank of lags, judged alike.
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

/// From the simplest on.
enum class Family { none, static_few, lagged_few, physical, lag_bank };
inline constexpr std::array<Family, 5> all_families{
    Family::none, Family::static_few, Family::lagged_few, Family::physical, Family::lag_bank};
[[nodiscard]] std::string_view to_string(Family family) noexcept;
[[nodiscard]] std::optional<Family> family_of(std::string_view name);

/// A family on folds left out. Everything that it chooses (places, lags, penalties) was chosen
/// anew on the other folds.
struct FamilyResult {
  Family family{Family::none};
  bool answers{false};
  std::string why_not;
  Eigen::MatrixXd left_out_um;               ///< prediction; shape (rows of the folds, outputs)
  std::vector<double> left_out_rms_um;       ///< one an output
  std::vector<std::vector<double>> fold_um;  ///< RMS, shape (outputs, folds)
  std::vector<double> scores;  ///< one a fold: sum over outputs of squares over those of no model
};

struct FamiliesFit {
  std::vector<FamilyResult> results;  ///< order of all_families
  Family chosen{Family::none};
  std::vector<double> other_half_um;  ///< of an only run: what the chosen one leaves of each half
                                      ///< by a model of the other, one an output
  std::string chosen_because;         ///< one line, with the figures that decided
  std::vector<std::vector<std::string>> together;  ///< places that always moved alike
  ThermalModel model;      ///< of the chosen family, on all rows, with [made_from]
  std::optional<Fit> few;  ///< the equation, where it is one of few sensors
  std::vector<std::string> warnings;

  [[nodiscard]] const FamilyResult& chosen_result() const;
};

/// One rule for none, static_few and lag_bank, on what is left out: whole runs; of one run
/// stretches and halves; of two or three runs stretches too. Out is what does worse than no model
/// anywhere it was judged; the bank stays unless few sensors leave a tenth less, and no model
/// unless one leaves a tenth less. lagged_few and physical are judged where they are forced.
/// @param forced    instead of it
/// @param progress  is told the share of the work done
/// @throws std::runtime_error when the forced family has no answer
[[nodiscard]] FamiliesFit fit_families(const MeasuredTests& tests, const FitOptions& options,
                                       std::optional<Family> forced,
                                       const std::function<void(double)>& progress);

/// Ranges, covariance and left-out errors of `fit.model`, without its own `made_from`.
[[nodiscard]] MadeFrom made_from_tests(const MeasuredTests& tests, const FamiliesFit& fit);

/// `fitted` with all inputs and outputs of `frame`, in its order, then those of its own, so that
/// the daemon's blocks and axes stay as they are: a place that the fit does not use has the
/// coefficient 0; an output that was not fitted keeps its row. Terms and `[made_from]` are those of
/// `fitted`.
/// @param notes  gets what a user should know: outputs that are kept or new, what is not taken over
/// @throws std::runtime_error when `frame` has terms, guideways or a course and an output that was
///         not fitted, which would lose them
[[nodiscard]] ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame,
                                    std::vector<std::string>& notes);

/// All families, and what the chosen one says of itself.
[[nodiscard]] std::string families_text(const MeasuredTests& tests, const FamiliesFit& fit);
/// One page with the table, curves of measured and left-out prediction, and the warnings.
[[nodiscard]] std::string families_html(const MeasuredTests& tests, const FamiliesFit& fit);
/// fit_json() where the chosen model is an equation of few sensors, with "families" and "family".
[[nodiscard]] std::string families_json(const MeasuredTests& tests, const FamiliesFit& fit);

}  // namespace thermocomp::identification
