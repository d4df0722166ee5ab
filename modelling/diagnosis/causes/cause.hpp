/// Causes of a wrong prediction. One function defines all of a cause, in the file of its family,
/// which ends with the list of its causes.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "modelling/diagnosis/hypothesis/hypothesis.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"
#include "modelling/diagnosis/network/machine_file.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"

namespace thermocomp::diagnosis {

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
  bool of_a_jump{false};  ///< identified by a jump, which nothing else on a machine resembles
};

/// Texts of the report.
struct CauseTexts {
  std::string_view title;
  std::string_view description;  ///< continues "SUBJECT: "
  std::string_view to_do;
};

/// The experiment that separates a cause from another: the first in this list of the two causes'.
enum class Experiment {
  of_a_network,    ///< steady state, the way there, the level
  another_run,     ///< a fault of one run does not come back
  standstill,      ///< one speed, then none
  along_the_axis,  ///< both ends and the middle
  twice_as_slow,   ///< a loop that does not close
  up_and_down,     ///< what has memory
  steady_levels,   ///< three temperatures held
  other_duty,      ///< anything else
};

/// Correction of one output for a cause without a term in the model file: a shift in time, or a
/// sine of known period and amplitude, whose phase is fitted in each run.
struct Correction {
  std::size_t output{0};
  double shift_s{0.0};
  double period_s{0.0};
  double amplitude_um{0.0};
};

struct Cause {
  /// Must not change: it is in answers, and in model files if the estimator has this term.
  std::string name;
  std::string family;                        ///< structure, heat, datum or sensor
  std::vector<CauseParameter> parameters{};  ///< in the order of the answer
  CauseTexts texts{};
  /// If the subject is a signal and a place of a thermal network; none: `texts`.
  std::optional<CauseTexts> texts_in_network{};
  /// If the subject is a signal without a unit; none: `texts`.
  std::optional<CauseTexts> texts_without_unit{};
  Experiment experiment{Experiment::other_duty};
  /// Hypotheses of its effect on the displacement; empty if it cannot act on the subject. Null: a
  /// cause of the thermal layer only.
  std::vector<Hypothesis> (*hypotheses)(const Material& material, const Subject& subject){nullptr};
  /// Converts its gains to parameters; null: one per gain.
  std::vector<Parameter> (*gains)(const FoundGains& found){nullptr};
  /// Correction from its parameters, for a cause of all runs without a term. Null: none.
  Correction (*correction)(const std::vector<Parameter>& parameters){nullptr};

  /// Hypotheses of its effect on the temperatures of a thermal network. Null: not in the thermal
  /// layer.
  std::vector<NetworkHypothesis> (*in_network)(const NetworkMaterial& material,
                                               const NetworkSubject& subject){nullptr};
  /// Writes a finding into the machine file. Null: the file has no key for this cause.
  /// @return whether the file has the subject
  bool (*into_machine)(MachineFile& machine, const std::string& subject,
                       const std::vector<Parameter>& parameters){nullptr};
};

/// Null: the cause has no parameter of this name.
[[nodiscard]] const CauseParameter* find_parameter(const Cause& cause, std::string_view name);

/// All causes, in the order in which they are tried.
[[nodiscard]] const std::vector<Cause>& all_causes();
/// @pre there is one
[[nodiscard]] const Cause& cause_named(std::string_view name);

namespace causes {

std::vector<Cause> of_structure();
std::vector<Cause> of_heat();
std::vector<Cause> of_datum();
std::vector<Cause> of_sensor();
std::vector<Cause> of_network();  ///< of the thermal layer only

}  // namespace causes

}  // namespace thermocomp::diagnosis
