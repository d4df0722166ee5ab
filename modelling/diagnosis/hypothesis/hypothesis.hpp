/// Hypotheses: a cause with a subject and the displacement it would explain; parameters with
/// intervals; the data from which causes compute their columns.
#pragma once

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {

struct Interval {
  double low{0.0};
  double high{0.0};
};

/// A parameter of a cause: one number, or one per output.
struct Parameter {
  std::string name;
  std::map<std::string, double> values;  ///< by output; key "" if all outputs share it
  std::map<std::string, Interval> ci95;  ///< the same keys; may be empty
};

/// The value that all outputs share; 0 if there is no such parameter.
[[nodiscard]] double shared_value(const std::vector<Parameter>& parameters,
                                  const std::string& name);

/// The gains of a finding in the form of the search.
struct FoundGains {
  const std::vector<std::string>& names;           ///< one per column of the hypothesis
  const std::vector<std::string>& outputs;         ///< of the model
  const std::vector<Eigen::VectorXd>& gains;       ///< one per output; empty: no effect on it
  const std::vector<std::vector<Interval>>& ci95;  ///< the same
};

/// Gain number `index` of every affected output.
[[nodiscard]] Parameter gain_table(const FoundGains& found, Eigen::Index index);
/// The first affected output.
[[nodiscard]] std::size_t first_output(const FoundGains& found);

/// Values of the shape parameters, in their order.
using Shape = std::vector<double>;
using Shapes = std::vector<Shape>;

/// How the columns of a hypothesis enter the displacement.
enum class Form {
  own_gains,    ///< each output has its own gains
  shared_gain,  ///< one gain for all outputs; their columns include their coefficients
  no_gain,      ///< only the shape is free
};

/// One shape parameter of a hypothesis, searched over a grid.
struct ShapeParameter {
  std::string name;
  std::vector<double> grid;  ///< ascending
  bool logarithmic{false};   ///< refined between grid points on a logarithmic scale
  bool discrete{false};      ///< not refined
};

struct Hypothesis {
  std::string subject{};
  Form form{Form::own_gains};
  std::vector<ShapeParameter> shape{};
  std::vector<std::string> gains{};     ///< names of the gains, one per column
  std::optional<std::size_t> output{};  ///< acts only on this output
  std::optional<std::size_t> run{};     ///< a fault in this run only
  /// Displacement of an output over all rows of a run, the columns of one shape after those of
  /// another: shape (rows, width() shapes).
  std::function<Panel(const MeasuredRun& run, const Shapes& shapes, std::size_t output)> effect{};
  /// The same over the stacked rows; 0 in other runs than `run`. Set by the catalogue.
  std::function<Panel(const Shapes& shapes, std::size_t output)> columns{};
  /// Physical range of a gain; empty: unbounded.
  std::function<Interval(std::size_t output)> bounds{};

  std::string cause{};  ///< set by the catalogue

  /// Special case of this hypothesis: this cause at the subject `simpler_subject`; empty: none.
  std::string simpler_cause{};
  std::string simpler_subject{};

  /// ln of its prior probability relative to the simpler form of the same cause.
  double log_prior{0.0};

  // Only for a fault of one reading:
  std::optional<std::size_t> sensor{};  ///< the input
  /// Error for a gain of 1 [K] over all rows of the run, one column per shape.
  std::function<Panel(const MeasuredRun& run, const Shapes& shapes)> errors_K{};
  bool shrinks_reading{false};  ///< the error is proportional to the reading

  /// Number of columns for one shape: that of the gains, at least 1.
  [[nodiscard]] Eigen::Index width() const { return std::max<Eigen::Index>(1, std::ssize(gains)); }
};

/// Number of fitted parameters: non-discrete shape parameters and gains of an output.
[[nodiscard]] std::size_t free_parameters(const Hypothesis& hypothesis);

/// All points of its grid; without shape parameters one empty point.
[[nodiscard]] Shapes grid_of(const Hypothesis& hypothesis);

/// The first parameter of each shape.
[[nodiscard]] std::vector<double> firsts_of(const Shapes& shapes);

/// Every cause (causes/cause.hpp) with every possible subject in these data.
[[nodiscard]] std::vector<Hypothesis> hypotheses(const MeasuredData& data);

enum class SubjectKind {
  input,              ///< a temperature of the model
  other_temperature,  ///< one that the model does not use
  signal,             ///< an operating signal
  output,
  output_in_run,  ///< an output in one run
  input_in_run,   ///< a temperature of the model in one run
};

/// Element of the data that a cause may act on.
struct Subject {
  SubjectKind kind{SubjectKind::input};
  std::size_t index{0};  ///< among MeasuredData's temperatures, signals, or the model's outputs
  std::size_t run{0};    ///< for kinds in one run
};

/// A column of each run.
using ColumnOf = std::function<const Column&(const MeasuredRun&)>;

class Material {
 public:
  /// @param data  must outlive it
  explicit Material(const MeasuredData& data);

  [[nodiscard]] const MeasuredData& data() const noexcept { return data_; }
  /// Median step between two rows.
  [[nodiscard]] double step_s() const noexcept { return step_s_; }
  /// Of the longest run.
  [[nodiscard]] double length_s() const noexcept { return length_s_; }
  /// What an output does in the end for each kelvin of an input, terms included, alone and with all
  /// places of its group; shape (outputs, inputs).
  /// @pre the model has no guideways
  [[nodiscard]] const Eigen::MatrixXd& settled_um_per_K() const noexcept { return settled_; }
  [[nodiscard]] const Eigen::MatrixXd& settled_of_group_um_per_K() const noexcept {
    return settled_of_group_;
  }

  [[nodiscard]] const std::string& name_of(const Subject& subject) const;
  /// The subject's values: denoised rises, or the signal as recorded.
  /// @pre a temperature or a signal
  [[nodiscard]] ColumnOf values_of(const Subject& subject) const;
  /// The room's temperature: one that the model does not use, else an input; nullopt: not recorded.
  [[nodiscard]] std::optional<Subject> room() const;
  [[nodiscard]] bool moves_anywhere(const ColumnOf& of) const;
  /// Largest range of the values within a run.
  [[nodiscard]] double range(const ColumnOf& of) const;

  /// Time constants within the range that step and length of the runs allow.
  [[nodiscard]] std::vector<double> lag_times_s(double low_s, double high_s,
                                                std::size_t count) const;
  /// Times between two shares of a run, and those of the largest jumps of its values; ascending.
  /// @param values  of all rows of the run; NaN: missing
  [[nodiscard]] std::vector<double> onsets_s(std::size_t run, double first, double last,
                                             std::size_t count, const Column& values) const;

 private:
  const MeasuredData& data_;
  Eigen::MatrixXd settled_;
  Eigen::MatrixXd settled_of_group_;
  double step_s_{1.0};
  double length_s_{0.0};
};

/// 1 from each onset on, else 0; shape (rows, onsets).
[[nodiscard]] Panel since(const Column& time_s, const std::vector<double>& onsets_s);

}  // namespace thermocomp::diagnosis
