/// The model of a machine as the model file gives it: plain data, no arithmetic.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

/// One `[[term]]` of the model file: an extension of the static matrix by a named cause.
struct TermSpec {
  std::string kind;                      ///< a registered cause, see term_kinds()
  std::string subject;                   ///< full column name, or two of them: "a|b", a < b
  std::map<std::string, double> shared;  ///< e.g. tau_s
  std::map<std::string, std::map<std::string, double>>
      per_output;  ///< e.g. gain_um_per_K -> output
};

/// `[guideway.NAME]`: rows of the matrix at positions along an axis. Between two positions the row
/// is interpolated linearly, beyond the ends the end's row holds.
/// Source: JP6507619B2, rows for the nodes of the guideway at the saddle's present position.
struct GuidewaySpec {
  std::string name;
  std::string axis;                  ///< position signal, e.g. "x_mm"
  std::vector<double> positions_mm;  ///< strictly increasing, at least two
  /// output -> rows, shape (positions, inputs) [um/K]; added to the output's row of the matrix
  std::map<std::string, std::vector<std::vector<double>>> rows_um_per_K;
};

/// Rows that a covariance of inputs may have: what is estimated must be so within a cycle.
inline constexpr std::size_t covariance_inputs_max = 64;
/// Without a figure in the model file: sqrt(2), since the residual at the moment of loss and that
/// of now differ, times sqrt(2) for a covariance that was itself estimated from a short record.
inline constexpr double drift_factor_default = 2.0;

/// `[covariance]` beside its matrix: how the error of an estimated input grows (LostBlocks).
struct CovarianceGrowth {
  double noise_K{0.02};                     ///< of a block's temperature; keeps the matrix regular
  double drift_time_s{0.0};                 ///< 0: at once
  double scatter_time_s{0.0};               ///< 0: at once
  std::vector<double> drift_factor;         ///< one an input; empty: drift_factor_default
  std::vector<double> scatter_factor;       ///< one an input; empty: 0
  void validate(std::size_t inputs) const;  ///< @throws InvalidValue
};

/// delta = P (T - T_ref) + guideway rows + terms. Shapes: matrix (outputs, inputs).
struct ThermalModel {
  std::vector<std::string> inputs;   ///< temperature columns, e.g. "t1_degC"
  std::vector<std::string> outputs;  ///< "z_um", "b_urad"
  /// One value an input [degC], or empty: the first valid sample.
  std::vector<double> reference_degC;
  std::vector<std::vector<double>> matrix_um_per_K;
  std::vector<GuidewaySpec> guideways;
  std::vector<TermSpec> terms;
  /// Covariance of the inputs [K^2], shape (inputs, inputs), or empty.
  std::vector<std::vector<double>> covariance_K2;
  CovarianceGrowth covariance_growth;

  /// Inputs, then every further temperature that a term names, in order of first use.
  [[nodiscard]] std::vector<std::string> temperature_columns() const;
  /// Every operating signal and position that terms and guideways name, in order of first use.
  [[nodiscard]] std::vector<std::string> signal_columns() const;
};

/// What the subject of a kind of term is, and which parameters it takes.
struct TermParameter {
  std::string name;
  bool per_output{false};
  double min{0.0};
  double max{0.0};
  bool whole_number{false};
};
enum class TermSubject {
  model_temperature,         ///< an input of the model
  other_temperature,         ///< a temperature that is no input
  any_temperature,           ///< either of the two
  signal,                    ///< an operating signal or a position
  output,                    ///< an output of the model
  two_model_temperatures,    ///< "a|b", both inputs
  temperature_and_position,  ///< "a|b", any temperature and a position, in lexical order
};
struct TermKind {
  std::string name;
  TermSubject subject;
  std::vector<TermParameter> parameters;
};

/// The columns that a subject names: one, or two with `|` between.
struct SubjectColumns {
  std::string first;
  std::string second;  ///< empty: there is one column
};
[[nodiscard]] SubjectColumns subject_columns(std::string_view subject);
/// Whether a column is called as a temperature is (*_degC, *_K).
[[nodiscard]] bool is_temperature_name(std::string_view column) noexcept;

/// Every kind of term that the daemon evaluates. Names and parameters: CAUSES, fixed. A name can be
/// there twice: for outputs and for temperatures.
[[nodiscard]] const std::vector<TermKind>& term_kinds();
/// @return the kind called `name` that takes such a subject, any kind of that name where none does,
///         nullptr where there is no such name
[[nodiscard]] const TermKind* find_term_kind(std::string_view name, std::string_view subject);

}  // namespace thermocomp
