/// What the families of models came to, side by side.
#pragma once

#include <array>
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

}  // namespace thermocomp::identification
