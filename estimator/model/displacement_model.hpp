/// delta = P (T - T_ref), with rows of guideways at the present position and extension terms.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Displacement of the model's outputs from temperatures and operating signals. The same code
/// predicts offline and compensates in the daemon.
/// Sources: JP6507619B2 eq. (1) and its guideway rows; docs/methods.md for the terms.
class DisplacementModel {
 public:
  /// @throws InvalidValue when shapes or names of `model` do not fit each other
  explicit DisplacementModel(const ThermalModel& model);
  ~DisplacementModel();
  DisplacementModel(DisplacementModel&&) noexcept;
  DisplacementModel& operator=(DisplacementModel&&) noexcept;

  /// Lags restart at the next step, in the steady state of their inputs.
  void restart() noexcept;

  /// @param now              time of the values; must not run backwards
  /// @param temps_degC       shape (temperature_columns)
  /// @param reference_degC   shape (temperature_columns)
  /// @param signals          shape (signal_columns)
  /// @param displacement_um  shape (outputs); overwritten. um, or urad for a tilt
  /// @pre sizes match the model (checked), values are finite. Never throws, never allocates;
  ///      O(outputs x inputs).
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const double> reference_degC, std::span<const double> signals,
            std::span<double> displacement_um) noexcept;

  /// The derivative of an output with respect to the temperatures, at these rises and positions:
  /// matrix, guideway rows and terms. For a lagged term, the larger of its initial and its final
  /// effect.
  /// @param rise_K          shape (temperature_columns)
  /// @param signals         shape (signal_columns)
  /// @param slope_um_per_K  shape (temperature_columns); overwritten
  /// Never throws, never allocates; O(columns + terms).
  void slope(std::size_t output, std::span<const double> rise_K, std::span<const double> signals,
             std::span<double> slope_um_per_K) const noexcept;

  void visit_state(StateArchive& archive);
  /// Takes over the states of all terms. @pre made from the same model. Never allocates.
  void copy_states(const DisplacementModel& same) noexcept;
  /// Takes over the states of terms with the same kind, subject and parameters; plan[i] is the
  /// index of the other model's term for ours, or -1. See plan_terms().
  void adopt_terms(const DisplacementModel& other, std::span<const int> plan) noexcept;
  [[nodiscard]] std::vector<int> plan_terms(const DisplacementModel& other) const;

 private:
  struct Equation;
  std::unique_ptr<Equation> equation_;
};

}  // namespace thermocomp
