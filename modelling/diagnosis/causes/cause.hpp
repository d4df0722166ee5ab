/// What may be wrong. All that is known of a cause stands in one function, in the file of its
/// family, which ends with the list of its causes.
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

/// What causes of a network are made of; all three outlive the hypotheses.
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

/// One thing of a network that a cause may act on.
struct NetworkSubject {
  NetworkSubjectKind kind{NetworkSubjectKind::part};
  std::size_t index{0};
  std::size_t second{0};
};

struct NetworkHypothesis {
  Hypothesis hypothesis{};  ///< without columns: they depend on what else was found
  /// Changes the network; a gain of 0 changes nothing. Empty: a fault of a reading.
  std::function<void(HeatNetwork&, const Shape&, double gain)> apply{};
  std::function<Column(const Shape&)> fault{};  ///< its column, where nothing is simulated
  double value{0.0};                            ///< of the file, that a factor multiplies
  std::string key{};                            ///< of the file, for this value
  double at{0.0};                               ///< signal at which a missing source has its heat
};

/// A parameter as the answer names it.
struct CauseParameter {
  std::string_view name;
  std::string_view unit;  ///< "s": a duration; "1": none; "?" in it: that of the subject
  /// What is physically possible, in this unit.
  double low{-std::numeric_limits<double>::infinity()};
  double high{std::numeric_limits<double>::infinity()};
  std::string_view description;  ///< before the value
  bool of_a_jump{false};  ///< recognised by a jump: nothing else that a machine does looks like it
};

/// What it says to the machine's owner.
struct CauseTexts {
  std::string_view title;
  std::string_view description;  ///< continues "SUBJECT: "
  std::string_view to_do;
};

/// The experiment that tells a cause from another. Of two causes the one that stands first here
/// says which.
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

/// What a finding changes that no term of the model file carries, in one output: a shift in time,
/// or a sine of known period and size. The sine's phase is another one in every run and is taken
/// from the run itself.
struct Correction {
  std::size_t output{0};
  double shift_s{0.0};
  double period_s{0.0};
  double amplitude_um{0.0};
};

struct Cause {
  /// Fixed: in answers, and in model files where the estimator has a term of this kind.
  std::string name;
  std::string family;  ///< what belongs together for a person: structure, heat, datum, sensor
  std::vector<CauseParameter> parameters{};  ///< in the order of the answer
  CauseTexts texts{};
  /// Where the subject is a signal and a place of a thermal network; none: the same.
  std::optional<CauseTexts> texts_in_network{};
  /// Where the subject is a signal without a unit; none: the same.
  std::optional<CauseTexts> texts_without_unit{};
  Experiment experiment{Experiment::other_duty};
  /// What it would do to the displacement, if the subject is one that it can have. Null: it is a
  /// cause of the thermal layer alone.
  std::vector<Hypothesis> (*hypotheses)(const Material& material, const Subject& subject){nullptr};
  /// Its gains as parameters; null: the first of each output, or the one that all share.
  std::vector<Parameter> (*gains)(const FoundGains& found){nullptr};
  /// Of a cause that acts in every run and that no term carries: what is corrected in its place,
  /// from its parameters. Null: nothing.
  Correction (*correction)(const std::vector<Parameter>& parameters){nullptr};

  /// What it would do to the temperatures of a thermal network. Null: the thermal layer does not
  /// have it.
  std::vector<NetworkHypothesis> (*in_network)(const NetworkMaterial& material,
                                               const NetworkSubject& subject){nullptr};
  /// Puts a finding into the machine's file. Null: no key of it carries the cause.
  /// @return whether the file has what the finding is about
  bool (*into_machine)(MachineFile& machine, const std::string& subject,
                       const std::vector<Parameter>& parameters){nullptr};
};

/// The parameter of this name; null: it has none.
[[nodiscard]] const CauseParameter* find_parameter(const Cause& cause, std::string_view name);

/// In the order in which they are tried.
[[nodiscard]] const std::vector<Cause>& all_causes();
/// @pre there is one
[[nodiscard]] const Cause& cause_named(std::string_view name);

namespace causes {

std::vector<Cause> of_structure();
std::vector<Cause> of_heat();
std::vector<Cause> of_datum();
std::vector<Cause> of_sensor();
std::vector<Cause> of_network();  ///< of the thermal layer alone

}  // namespace causes

}  // namespace thermocomp::diagnosis
