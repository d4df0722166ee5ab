/// An extension of the static model by a named cause, evaluated at run time.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// What a term sees of one step.
struct TermInput {
  nanoseconds now{};
  std::span<const double> rise_K;            ///< temperature_columns(): T - T_ref
  std::span<const double> signals;           ///< signal_columns()
  std::span<const double> reference_degC{};  ///< T_ref of temperature_columns(); not in a slope
};

/// A step runs through three stages, each over all terms in the order of the model file. A term
/// overrides the one in which it acts. No allocation, no exception.
class Term {
 public:
  Term() = default;
  Term(const Term&) = delete;
  Term& operator=(const Term&) = delete;
  virtual ~Term() = default;
  /// What a reading should have been; matrix, guideways and the later stages see the corrected
  /// rise.
  virtual void correct_rise(nanoseconds /*now*/, std::span<double> /*rise_K*/) noexcept {}
  /// Adds the term's displacement to that of matrix and guideways.
  virtual void add(const TermInput& /*input*/, std::span<double> /*displacement_um*/) noexcept {}
  /// What the structure makes of the displacement.
  virtual void correct_displacement(std::span<double> /*displacement_um*/) noexcept {}

  /// Adds how much `output` moves with each temperature by this term in the end
  /// [um/K], shape (temperature_columns); for the spread of an offset. Every kind must say it, even
  /// where it is nothing: for an operating signal, or a temperature passed on late.
  virtual void add_slope(const TermInput& input, std::size_t output,
                         std::span<double> slope_um_per_K) const noexcept = 0;
  /// After all add_slope(): the effect on the way, where it is larger than in the end.
  virtual void add_slope_on_the_way(std::size_t /*output*/,
                                    std::span<double> /*slope_um_per_K*/) const noexcept {}
  /// After both: from the corrected rise to what was read.
  virtual void correct_slope(std::span<double> /*slope_um_per_K*/) const noexcept {}
  /// Forgets the past: lags start at their input's present value.
  virtual void restart() noexcept = 0;
  virtual void visit_state(StateArchive& archive) = 0;
};

/// What a term is made from: its specification with names resolved to indices.
struct TermContext {
  const TermSpec& spec;
  /// Index among temperature_columns(), signal_columns() or outputs; of two columns the first.
  std::size_t subject;
  std::size_t second;  ///< of two columns the second; else 0
  /// Values of a per-output parameter in the order of the model's outputs, 0 where not given.
  std::function<std::vector<double>(std::string_view name)> per_output;
  std::function<double(std::string_view name)> shared;
  /// Of a lag_bank: index of each subject among temperature_columns() or signal_columns().
  std::vector<std::size_t> bank_columns{};
  std::vector<double> bank_gains{};  ///< shape (outputs, time constants, subjects)
};

/// A kind of term and how it is made. To add one: a file with its registration, and its lines at
/// the end of this file and in term_registrations().
struct TermRegistration {
  TermKind kind{};
  std::unique_ptr<Term> (*make)(const TermContext& context){nullptr};
};

[[nodiscard]] const std::vector<TermRegistration>& term_registrations();

/// The columns of a model. Made once for all of its terms, since each has a share in them.
struct ModelColumns {
  explicit ModelColumns(const ThermalModel& model)
      : temperatures(model.temperature_columns()), signals(model.signal_columns()) {}
  std::vector<std::string> temperatures;
  std::vector<std::string> signals;
};

/// @throws InvalidValue when the specification does not fit the model
[[nodiscard]] std::unique_ptr<Term> make_term(const TermSpec& spec, const ThermalModel& model,
                                              const ModelColumns& columns);

/// Every kind: each has a file of this folder and an entry of term_registrations().
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
