/// The model of a machine as the model file gives it: plain data, no arithmetic.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

// Largest magnitudes believed; one place, so that all kinds of terms agree.
inline constexpr double term_gain_max = 1e6;
inline constexpr double term_tau_s_max = 1e6;
inline constexpr double term_tau_s_min = 1e-3;
/// Columns and time constants of a bank of lags: what a cycle may cost.
inline constexpr std::size_t bank_subjects_max = 256;
inline constexpr std::size_t bank_taus_max = 16;

/// What a `lag_bank` has beside other terms: low passes of several columns at several time
/// constants, a gain for each.
struct LagBankSpec {
  std::vector<std::string> subjects;  ///< temperatures (their rise), signals or positions
  std::vector<double> powers;         ///< of each subject, 1 or 2; empty: all 1
  std::vector<double> taus_s;         ///< ascending; 0: the value itself
  /// output -> gains, shape (subjects, time constants) [um per unit of the subject to its power]
  std::map<std::string, std::vector<std::vector<double>>> gain_um_per_unit;

  bool operator==(const LagBankSpec& other) const = default;
};

/// One `[[term]]` of the model file: an extension of the static matrix by a named cause.
struct TermSpec {
  std::string kind;                      ///< a registered cause, see term_kinds()
  std::string subject;                   ///< full column name, or two of them: "a|b", a < b
  std::map<std::string, double> shared;  ///< e.g. tau_s
  std::map<std::string, std::map<std::string, double>>
      per_output;      ///< e.g. gain_um_per_K -> output
  LagBankSpec bank{};  ///< of a bank, which has no subject of its own

  /// Its kind names subjects, gains and time constants in `bank`.
  [[nodiscard]] bool is_bank() const;
  /// Columns or outputs that it names, as they stand there: of a bank all of them, else one or two.
  [[nodiscard]] std::vector<std::string> subjects() const;
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
  std::vector<double> drift_factor;         ///< one per input; empty: drift_factor_default
  std::vector<double> scatter_factor;       ///< one per input; empty: 0
  void validate(std::size_t inputs) const;  ///< @throws InvalidValue
};

/// `[made_from]`: the rows that a model was made from and what it left there, which tells how far a
/// prediction may be believed.
struct MadeFrom {
  /// Of one output, in its own unit.
  struct Output {
    double remainder_rms_um{0.0};  ///< of the rows that it was fitted to
    double noise_um{0.0};          ///< share of the remainder that differs from row to row
    double noise_time_s{0.0};      ///< time in which the rest falls to 1/e of its correlation
    double left_out_rms_um{0.0};   ///< on what was left out
    double no_model_rms_um{0.0};   ///< there without a model
    double freedom{1.0};           ///< rows that the correlated ones are worth

    bool operator==(const Output& other) const = default;
  };
  std::vector<std::string> runs;  ///< as given
  double rows{0.0};
  double hours{0.0};
  bool within_one_run{false};        ///< judged on blocks of the only run
  std::vector<std::string> columns;  ///< temperatures and signals that the model reads
  std::vector<double> low;           ///< one per column, as recorded (degC, not rise)
  std::vector<double> high;
  /// The domain: levels of the temperatures, then rises and signals after each low pass, 0 among
  /// them; see ModelDomain.
  std::vector<double> taus_s;
  std::vector<double> mean;                     ///< one per feature
  std::vector<std::vector<double>> covariance;  ///< shape (features, features)
  double distance_max{0.0};                     ///< beyond it a row is outside
  std::map<std::string, Output> outputs;

  bool operator==(const MadeFrom& other) const = default;
};
inline constexpr std::size_t domain_features_max = 256;
inline constexpr std::size_t domain_taus_max = 8;

/// Where a machine stands in the course of its heat; see HeatPhase.
enum class CoursePhase : std::uint8_t { heating, turned, cooling };
inline constexpr std::size_t course_points_max = 512;  ///< of an output: what a look-up may cost

/// `[course]`: what probed courses taught about the gains of a correction (`[correction]` of the
/// daemon's file), state by state, for times when nothing is probed; see CourseLookup.
struct RecordedCourse {
  struct Point {
    CoursePhase phase{};
    double since_s{0.0};         ///< since the heat came or went
    std::vector<double> rise_K;  ///< one per input
    std::vector<double> gain;    ///< one per group
    std::vector<double> sd;      ///< one per group

    bool operator==(const Point& other) const = default;
  };
  std::vector<std::string> runs;                 ///< as given
  std::vector<std::vector<std::string>> groups;  ///< inputs that share a gain
  double bandwidth{0.5};                         ///< in spreads of the points
  std::map<std::string, std::vector<Point>> outputs;

  bool operator==(const RecordedCourse& other) const = default;
};

/// `[[diameter]]`: an output that is a diameter of the work, twice what the axis has to move.
struct DiameterSpec {
  std::string output;  ///< "dia_um"
  std::string axis;    ///< of the daemon's file, "x"
  double sign{1.0};    ///< -1: the diameter grows as the axis moves in its negative direction

  bool operator==(const DiameterSpec& other) const = default;
};

/// delta = P (T - T_ref) + guideway rows + terms. Shapes: matrix (outputs, inputs).
struct ThermalModel {
  std::vector<std::string> inputs;   ///< temperature columns, e.g. "t1_degC"
  std::vector<std::string> outputs;  ///< "z_um", "b_urad"
  /// One value per input [degC], or empty: the first valid sample.
  std::vector<double> reference_degC;
  std::vector<std::vector<double>> matrix_um_per_K;
  std::vector<GuidewaySpec> guideways;
  std::vector<TermSpec> terms;
  /// Covariance of the inputs [K^2], shape (inputs, inputs), or empty.
  std::vector<std::vector<double>> covariance_K2;
  CovarianceGrowth covariance_growth;
  std::optional<MadeFrom> made_from;
  std::optional<RecordedCourse> course;
  std::vector<DiameterSpec> diameters;

  /// Inputs, then every further temperature that a term names, in order of first use.
  [[nodiscard]] std::vector<std::string> temperature_columns() const;
  /// Every operating signal and position that terms and guideways name, in order of first use.
  [[nodiscard]] std::vector<std::string> signal_columns() const;
};

/// Whether the model file itself says, for each output, what the model left of measured
/// displacement that it was not fitted to (`[made_from]`). Without it, as with an example or a
/// computed model, nothing tells whether size and sign are those of any machine.
[[nodiscard]] bool is_compared(const ThermalModel& model);

/// nullptr: the output is none.
[[nodiscard]] const DiameterSpec* diameter_of(const ThermalModel& model,
                                              std::string_view output) noexcept;
/// "half of dia_um", "-half of dia_um": what the axis takes out.
[[nodiscard]] std::string half_of(const DiameterSpec& diameter);
/// The same model with its diameters as displacements of their axes: half of them, with their
/// sign, in matrix, guideways, terms and remainders.
[[nodiscard]] ThermalModel of_axes(ThermalModel model);

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
  other_temperature,         ///< a temperature that is not an input
  any_temperature,           ///< either of the two
  signal,                    ///< an operating signal or a position
  output,                    ///< an output of the model
  two_model_temperatures,    ///< "a|b", both inputs
  temperature_and_position,  ///< "a|b", any temperature and a position, in lexical order
  column_and_temperature,    ///< "a|b": a temperature, signal or position, then a temperature
  several,                   ///< no single subject: LagBankSpec names them
};
struct TermKind {
  std::string name;
  TermSubject subject;
  std::vector<TermParameter> parameters;

  [[nodiscard]] bool is_bank() const noexcept { return subject == TermSubject::several; }
};

/// The columns that a subject names: one, or two with `|` between.
struct SubjectColumns {
  std::string first;
  std::string second;  ///< empty: there is one column
};
[[nodiscard]] SubjectColumns subject_columns(std::string_view subject);
/// Whether a column's name is that of a temperature (*_degC, *_K).
[[nodiscard]] bool is_temperature_name(std::string_view column) noexcept;

/// Every kind of term that the daemon evaluates, with the names and parameters of model files
/// (docs/methods.md). A name can be there twice: for outputs and for temperatures.
[[nodiscard]] const std::vector<TermKind>& term_kinds();
/// @return the kind called `name` that takes such a subject, any kind of that name where none does,
///         nullptr where there is no such name
[[nodiscard]] const TermKind* find_term_kind(std::string_view name, std::string_view subject);

}  // namespace thermocomp
