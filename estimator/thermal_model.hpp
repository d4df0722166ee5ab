/// Contents of a model file as plain data.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

// Largest accepted magnitudes, common to all kinds of terms.
inline constexpr double term_gain_max = 1e6;
inline constexpr double term_tau_s_max = 1e6;
inline constexpr double term_tau_s_min = 1e-3;
/// Largest bank of lags, for its cost per cycle.
inline constexpr std::size_t bank_subjects_max = 256;
inline constexpr std::size_t bank_taus_max = 16;

/// Parameters of a `lag_bank`: low passes of columns at time constants, each with a gain.
struct LagBankSpec {
  std::vector<std::string> subjects;  ///< temperatures (their rise), signals or positions
  std::vector<double> powers;         ///< one per subject, 1 or 2; empty: all 1
  std::vector<double> taus_s;         ///< ascending; 0: unfiltered
  /// output -> gains, shape (subjects, time constants) [um per unit of the subject to its power]
  std::map<std::string, std::vector<std::vector<double>>> gain_um_per_unit;

  bool operator==(const LagBankSpec& other) const = default;
};

/// One `[[term]]` of the model file: a named cause that extends the static matrix.
struct TermSpec {
  std::string kind;                      ///< a registered cause, see term_kinds()
  std::string subject;                   ///< full column name, or two: "a|b", a < b
  std::map<std::string, double> shared;  ///< e.g. tau_s
  std::map<std::string, std::map<std::string, double>>
      per_output;      ///< e.g. gain_um_per_K -> output
  LagBankSpec bank{};  ///< only of a bank, which has no `subject`

  bool operator==(const TermSpec& other) const = default;

  /// True for a kind whose subjects, gains and time constants are in `bank`.
  [[nodiscard]] bool is_bank() const;
  /// Names of its columns or outputs: all of a bank's, else one or two.
  [[nodiscard]] std::vector<std::string> subjects() const;
};

/// `[guideway.NAME]`: rows of the matrix at positions along an axis, interpolated linearly; beyond
/// the ends the end's row holds.
/// Source: JP6507619B2, rows for the nodes of the guideway at the saddle's present position.
struct GuidewaySpec {
  std::string name;
  std::string axis;                  ///< position signal, e.g. "x_mm"
  std::vector<double> positions_mm;  ///< strictly increasing, at least two
  /// output -> rows, shape (positions, inputs) [um/K]; added to the output's row of the matrix
  std::map<std::string, std::vector<std::vector<double>>> rows_um_per_K;

  bool operator==(const GuidewaySpec& other) const = default;
};

/// Largest covariance, for the cost of an estimate per cycle.
inline constexpr std::size_t covariance_inputs_max = 64;
/// Default without a figure in the model file: sqrt(2), since the residuals at the loss and now
/// differ, times sqrt(2) for a covariance estimated from a short record.
inline constexpr double drift_factor_default = 2.0;

/// Further keys of `[covariance]`: growth of the error of an estimated input (LostBlocks).
struct CovarianceGrowth {
  double noise_K{0.02};                     ///< of a block temperature; keeps the matrix regular
  double drift_time_s{0.0};                 ///< 0: at once
  double scatter_time_s{0.0};               ///< 0: at once
  std::vector<double> drift_factor;         ///< one per input; empty: drift_factor_default
  std::vector<double> scatter_factor;       ///< one per input; empty: 0
  void validate(std::size_t inputs) const;  ///< @throws InvalidValue
};

/// `[made_from]`: data of the model's fit and what it left there, from which the error of a
/// prediction follows.
struct MadeFrom {
  /// One output, in its own unit.
  struct Output {
    double remainder_rms_um{0.0};  ///< in the fitted rows
    double noise_um{0.0};          ///< part of the remainder that is uncorrelated from row to row
    double noise_time_s{0.0};      ///< correlation time (1/e) of the rest
    double left_out_rms_um{0.0};   ///< in the left-out data
    double no_model_rms_um{0.0};   ///< in the left-out data without a model
    double freedom{1.0};  ///< number of independent rows that the correlated ones are worth

    bool operator==(const Output& other) const = default;
  };
  std::vector<std::string> runs;
  double rows{0.0};
  double hours{0.0};
  bool within_one_run{false};        ///< the left-out data were blocks of the only run
  std::vector<std::string> columns;  ///< temperatures and signals that the model reads
  std::vector<double> low;           ///< one per column, as recorded (degC, not rise)
  std::vector<double> high;
  /// Domain, see ModelDomain. Features: levels of the temperatures, then rises and signals after
  /// each low pass (taus_s, 0 among them).
  std::vector<double> taus_s;
  std::vector<double> mean;                     ///< one per feature
  std::vector<std::vector<double>> covariance;  ///< shape (features, features)
  double distance_max{0.0};                     ///< a row at a larger distance is outside
  std::map<std::string, Output> outputs;

  bool operator==(const MadeFrom& other) const = default;
};
inline constexpr std::size_t domain_features_max = 256;
inline constexpr std::size_t domain_taus_max = 8;

/// Phase of a machine's heating or cooling; see HeatPhase.
enum class CoursePhase : std::uint8_t { heating, turned, cooling };
inline constexpr std::size_t course_points_max = 512;  ///< per output, for the cost of a look-up

/// `[course]`: gains of a correction (`[correction]` of the daemon's file) learned from probed
/// courses, by machine state, for times without probing; see CourseLookup.
struct RecordedCourse {
  struct Point {
    CoursePhase phase{};
    double since_s{0.0};         ///< since heating or cooling began
    std::vector<double> rise_K;  ///< one per input
    std::vector<double> gain;    ///< one per group
    std::vector<double> sd;      ///< one per group

    bool operator==(const Point& other) const = default;
  };
  std::vector<std::string> runs;
  std::vector<std::vector<std::string>> groups;  ///< inputs that share a gain
  double bandwidth{0.5};                         ///< in units of the points' spread
  std::map<std::string, std::vector<Point>> outputs;

  bool operator==(const RecordedCourse& other) const = default;
};

/// `[[diameter]]`: an output that is a diameter of the work, twice the displacement of the axis.
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

  /// Inputs, then further temperatures of the terms, in order of first use.
  [[nodiscard]] std::vector<std::string> temperature_columns() const;
  /// Operating signals and positions of guideways and terms, in order of first use.
  [[nodiscard]] std::vector<std::string> signal_columns() const;
};

/// True if `[made_from]` gives every output's remainder in left-out data. Without it, as with an
/// example or a computed model, it is not known whether size and sign are those of any machine.
[[nodiscard]] bool is_compared(const ThermalModel& model);

/// Whether both predict the same displacement and have the same domain.
[[nodiscard]] bool predict_the_same(const ThermalModel& a, const ThermalModel& b);

/// Some coefficient is not zero; `thermocomp init` writes zeros.
[[nodiscard]] bool has_gain(const ThermalModel& model);
/// Some coefficient of this output is not zero.
[[nodiscard]] bool has_gain(const ThermalModel& model, const std::string& output);

/// nullptr: the output is no diameter.
[[nodiscard]] const DiameterSpec* diameter_of(const ThermalModel& model,
                                              std::string_view output) noexcept;
/// "half of dia_um", "-half of dia_um": displacement that the axis compensates.
[[nodiscard]] std::string half_of(const DiameterSpec& diameter);
/// The model with each diameter replaced by the displacement of its axis: half of it with its sign,
/// in matrix, guideways, terms and remainders.
[[nodiscard]] ThermalModel in_axis_units(ThermalModel model);

/// A parameter of a kind of term.
struct TermParameter {
  std::string name;
  bool per_output{false};
  double min{0.0};
  double max{0.0};
  bool whole_number{false};
};
enum class TermSubject {
  model_temperature,  ///< an input of the model
  other_temperature,  ///< a temperature that is not an input
  any_temperature,    ///< either of the two
  signal,             ///< an operating signal or a position
  output,
  two_model_temperatures,    ///< "a|b", both inputs
  temperature_and_position,  ///< "a|b", any temperature and a position, in lexical order
  column_and_temperature,    ///< "a|b": a temperature, signal or position, then a temperature
  several,                   ///< no single subject; see LagBankSpec
};
struct TermKind {
  std::string name;
  TermSubject subject;
  std::vector<TermParameter> parameters;

  [[nodiscard]] bool is_bank() const noexcept { return subject == TermSubject::several; }
};

/// Columns of a subject: one, or two separated by `|`.
struct SubjectColumns {
  std::string first;
  std::string second;  ///< empty if there is one column
};
[[nodiscard]] SubjectColumns subject_columns(std::string_view subject);
/// True for the name of a temperature (*_degC, *_K).
[[nodiscard]] bool is_temperature_name(std::string_view column) noexcept;

/// All kinds of terms that the daemon evaluates, with names and parameters as in model files
/// (docs/methods.md). A name may occur twice: for outputs and for temperatures.
[[nodiscard]] const std::vector<TermKind>& term_kinds();
/// @return the kind `name` that takes this subject, else any kind of that name, else nullptr
[[nodiscard]] const TermKind* find_term_kind(std::string_view name, std::string_view subject);

}  // namespace thermocomp
