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
  std::span<const double> rise_K;   ///< temperature_columns(): T - T_ref
  std::span<const double> signals;  ///< signal_columns()
};

class Term {
 public:
  Term() = default;
  Term(const Term&) = delete;
  Term& operator=(const Term&) = delete;
  virtual ~Term() = default;
  /// Adds the term's displacement. No allocation, no exception.
  virtual void add(const TermInput& input, std::span<double> displacement_um) noexcept = 0;
  /// Forgets the past: lags start at their input's present value.
  virtual void restart() noexcept = 0;
  virtual void visit_state(StateArchive& archive) = 0;
};

/// What a term is made from: its specification with names resolved to indices.
struct TermContext {
  const TermSpec& spec;
  std::size_t subject;  ///< index among temperature_columns() or signal_columns()
  /// Values of a per-output parameter in the order of the model's outputs, 0 where not given.
  std::function<std::vector<double>(std::string_view name)> per_output;
  std::function<double(std::string_view name)> shared;
};

/// A kind of term and how it is made. To add one: a file with its registration, and its line in
/// term_registry.cpp.
struct TermRegistration {
  TermKind kind{};
  std::unique_ptr<Term> (*make)(const TermContext& context){nullptr};
};

[[nodiscard]] const std::vector<TermRegistration>& term_registrations();

/// @throws InvalidValue when the specification does not fit the model
[[nodiscard]] std::unique_ptr<Term> make_term(const TermSpec& spec, const ThermalModel& model);

// Largest magnitudes believed; one place, so that all kinds agree.
inline constexpr double term_gain_max = 1e6;
inline constexpr double term_tau_s_max = 1e6;
inline constexpr double term_tau_s_min = 1e-3;

TermRegistration thermal_lag_registration();
TermRegistration missing_heat_source_registration();
TermRegistration missing_temperature_registration();
TermRegistration speed_growth_registration();

}  // namespace thermocomp
