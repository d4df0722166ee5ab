/// Extensions of the static model by named causes, evaluated at run time.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

struct TermInput {
  nanoseconds now{};
  std::span<const double> rise_K;            ///< temperature_columns(): T - T_ref
  std::span<const double> signals;           ///< signal_columns()
  std::span<const double> reference_degC{};  ///< T_ref of temperature_columns(); empty for a slope
};

/// A step has three stages, each over all terms in the order of the model file. A term overrides
/// the stage in which it acts. No allocation, no exception.
class Term {
 public:
  Term() = default;
  Term(const Term&) = delete;
  Term& operator=(const Term&) = delete;
  virtual ~Term() = default;
  /// Corrects readings; matrix, guideways and later stages use the corrected rise.
  virtual void correct_rise(nanoseconds /*now*/, std::span<double> /*rise_K*/) noexcept {}
  /// Adds the term's displacement to that of matrix and guideways.
  virtual void add(const TermInput& /*input*/, std::span<double> /*displacement_um*/) noexcept {}
  /// Changes the displacement as the structure does, e.g. by the play of a joint.
  virtual void correct_displacement(std::span<double> /*displacement_um*/) noexcept {}

  /// Adds the steady-state derivative of `output` with respect to each temperature [um/K], shape
  /// (temperature_columns), for the standard deviation of an offset. It is 0 for operating signals
  /// and lagged temperatures; pure virtual, so that each kind states it.
  virtual void add_slope(const TermInput& input, std::size_t output,
                         std::span<double> slope_um_per_K) const noexcept = 0;
  /// After all add_slope(): the transient effect, where larger than the steady state.
  virtual void add_transient_slope(std::size_t /*output*/,
                                   std::span<double> /*slope_um_per_K*/) const noexcept {}
  /// After both: from the corrected rise to the reading.
  virtual void correct_slope(std::span<double> /*slope_um_per_K*/) const noexcept {}
  /// Clears the past: lags start at their input's present value.
  virtual void restart() noexcept = 0;
  virtual void visit_state(StateArchive& archive) = 0;
};

/// Specification of a term, with names resolved to indices.
struct TermContext {
  const TermSpec& spec;
  /// Index among temperature_columns(), signal_columns() or outputs; the first of two columns.
  std::size_t subject;
  std::size_t second;  ///< the second of two columns; else 0
  /// Values of a per-output parameter in the order of the model's outputs; 0: not given.
  std::function<std::vector<double>(std::string_view name)> per_output;
  std::function<double(std::string_view name)> shared;
  /// lag_bank: index of each subject among temperature_columns() or signal_columns().
  std::vector<std::size_t> bank_columns{};
  std::vector<double> bank_gains{};  ///< shape (outputs, time constants, subjects)
};

/// A kind of term and its factory. A new kind needs a file with its registration, and its lines at
/// the end of this file and in term_registrations().
struct TermRegistration {
  TermKind kind{};
  std::unique_ptr<Term> (*make)(const TermContext& context){nullptr};
};

[[nodiscard]] const std::vector<TermRegistration>& term_registrations();

/// Columns of a model, determined once for all of its terms.
struct ModelColumns {
  explicit ModelColumns(const ThermalModel& model)
      : temperatures(model.temperature_columns()), signals(model.signal_columns()) {}
  std::vector<std::string> temperatures;
  std::vector<std::string> signals;
};

/// @throws InvalidValue when the specification does not fit the model
[[nodiscard]] std::unique_ptr<Term> make_term(const TermSpec& spec, const ThermalModel& model,
                                              const ModelColumns& columns);

/// One per kind of term, each with a file of this folder.
TermRegistration thermal_lag_registration();
TermRegistration missing_heat_source_registration();
TermRegistration missing_temperature_registration();
TermRegistration speed_growth_registration();
TermRegistration slow_sensor_registration();
TermRegistration wrong_coefficient_registration();
TermRegistration nonlinear_expansion_registration();
TermRegistration position_dependence_registration();
TermRegistration output_hysteresis_registration();
TermRegistration temperature_hysteresis_registration();
TermRegistration sensor_swap_registration();
TermRegistration lag_bank_registration();
TermRegistration signal_hinge_registration();
TermRegistration start_dependence_registration();

}  // namespace thermocomp
