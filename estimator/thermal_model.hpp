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
  std::string subject;                   ///< full column name (temperature or operating signal)
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
enum class TermSubject { model_temperature, other_temperature, signal };
struct TermKind {
  std::string name;
  TermSubject subject;
  std::vector<TermParameter> parameters;
};

/// Every kind of term that the daemon evaluates. Names and parameters: CAUSES, fixed.
[[nodiscard]] const std::vector<TermKind>& term_kinds();
/// @return the kind called `name`, or nullptr
[[nodiscard]] const TermKind* find_term_kind(std::string_view name);

}  // namespace thermocomp
