/// Causes of a wrong prediction. One function defines a cause, in the file of its family, which
/// ends with the list of its causes. A hypothesis is a cause with a subject and the displacement
/// that it would explain.
#pragma once

#include <algorithm>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"
#include "modelling/diagnosis/network/machine_file.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"

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
  const std::vector<std::string>& names;           ///< one name per column of the hypothesis
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
  /// Steady-state effect on an output per kelvin of an input, terms included, alone and with all
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

/// Data for causes of a network; all three must outlive the hypotheses.
struct NetworkMaterial {
  const ThermalPlant& plant;
  const ThermalRuns& runs;
  const StackedRows& rows;
};

enum class NetworkSubjectKind {
  part,             ///< of ThermalPlant::parts
  source,           ///< of the network's
  signal_at_place,  ///< a place, and a signal as `second`
  room,
  air_of_part,    ///< the air around a part that has a film
  sensor,         ///< of the network's
  sensor_in_run,  ///< and the run as `second`
};

/// Element of a network that a cause may act on.
struct NetworkSubject {
  NetworkSubjectKind kind{NetworkSubjectKind::part};
  std::size_t index{0};
  std::size_t second{0};
};

struct NetworkHypothesis {
  Hypothesis hypothesis{};  ///< without columns, which depend on the other findings
  /// Changes the network in proportion to the gain. Empty: a fault of a reading.
  std::function<void(HeatNetwork&, const Shape&, double gain)> apply{};
  std::function<Column(const Shape&)> fault{};  ///< column of a fault of a reading
  double value{0.0};                            ///< in the machine file; a factor multiplies it
  std::string key{};                            ///< of this value in the machine file
  double at{0.0};  ///< signal value at which a missing source has its heat
};

/// A parameter in answers and reports.
struct CauseParameter {
  std::string_view name;
  std::string_view unit;  ///< "s": a duration; "1": none; "?": the subject's unit
  /// Physical range in this unit.
  double low{-std::numeric_limits<double>::infinity()};
  double high{std::numeric_limits<double>::infinity()};
  std::string_view description;  ///< text in front of the value
  bool of_a_jump{false};         ///< identified by a jump, which has no other cause on a machine
};

/// Texts of the report.
struct CauseTexts {
  std::string_view title;
  std::string_view description;  ///< continues "SUBJECT: "
  std::string_view to_do;
};

/// The experiment that separates two causes: of their experiments, the first in this list.
enum class Experiment {
  of_a_network,    ///< steady state, transient, level
  another_run,     ///< a fault of one run does not recur
  standstill,      ///< one speed, then none
  along_the_axis,  ///< both ends and the middle
  twice_as_slow,   ///< a hysteresis loop
  up_and_down,     ///< effects with memory
  steady_levels,   ///< three temperatures held
  other_duty,      ///< anything else
};

/// Effect of a finding whose cause has no term in the model file; each function may be empty.
struct Correction {
  /// Changes the readings of a run before the model is evaluated.
  std::function<void(const MeasuredData& data, MeasuredRun& run)> readings{};
  /// Changes the prediction of an affected output over all rows of the run.
  std::function<void(const MeasuredRun& run, std::size_t output, Column& predicted_um)>
      prediction{};
  std::vector<bool> affects{};  ///< per output; set from the finding
};

struct Cause {
  /// Must not change: used in answers, and in model files if the estimator has this term.
  std::string name;
  std::string family;                        ///< structure, heat, datum or sensor
  std::vector<CauseParameter> parameters{};  ///< in the order of the answer
  CauseTexts texts{};
  /// Replaces `texts` if the subject is a signal and a place of a thermal network.
  std::optional<CauseTexts> texts_in_network{};
  /// Replaces `texts` if the subject is a signal without a unit.
  std::optional<CauseTexts> texts_without_unit{};
  Experiment experiment{Experiment::other_duty};
  /// Hypotheses of its effect on the displacement; empty if it cannot act on the subject. Null: a
  /// cause of the thermal layer only.
  std::vector<Hypothesis> (*hypotheses)(const Material& material, const Subject& subject){nullptr};
  /// Converts its gains to parameters; null: one per gain.
  std::vector<Parameter> (*gains)(const FoundGains& found){nullptr};
  /// Correction from a finding, for a cause of all runs without a term. Null: none.
  Correction (*correction)(const std::vector<Parameter>& parameters,
                           const std::string& subject){nullptr};

  /// Hypotheses of its effect on the temperatures of a thermal network. Null: not in the thermal
  /// layer.
  std::vector<NetworkHypothesis> (*in_network)(const NetworkMaterial& material,
                                               const NetworkSubject& subject){nullptr};
  /// Writes a finding into the machine file. Null: the file has no key for this cause.
  /// @return true if the file has the subject
  bool (*into_machine)(MachineFile& machine, const std::string& subject,
                       const std::vector<Parameter>& parameters){nullptr};
};

/// Null: the cause has no parameter of this name.
[[nodiscard]] const CauseParameter* find_parameter(const Cause& cause, std::string_view name);

/// All causes, in the order in which they are tried.
[[nodiscard]] const std::vector<Cause>& all_causes();
/// @pre there is one
[[nodiscard]] const Cause& cause_named(std::string_view name);

/// Every cause with every possible subject in these data.
[[nodiscard]] std::vector<Hypothesis> hypotheses(const MeasuredData& data);

namespace causes {

std::vector<Cause> of_structure();
std::vector<Cause> of_heat();
std::vector<Cause> of_datum();
std::vector<Cause> of_sensor();
std::vector<Cause> of_network();  ///< of the thermal layer only

}  // namespace causes

}  // namespace thermocomp::diagnosis
