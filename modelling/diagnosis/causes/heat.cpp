/// Heat or growth that depends on an operating signal and on no measured temperature.
#include <algorithm>

#include "config/text/units.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr CauseParameter tau{"tau_s", "s", 120.0, 6 * 3600.0, "time constant"};
constexpr CauseParameter power{"power", "1", 1.0, 2.0, "power of the signal"};
/// ln of the prior probability of the form with the room. Set with seeds 22 and 77 of
/// physical_campaign.py and seed 910000, level 3, of simulated_campaign.py.
constexpr double log_prior_of_room = -1.0;

/// Two forms: heat only, and heat with the room, whose temperature warms the same body.
std::vector<Hypothesis> missing_heat_source_hypotheses(const Material& material,
                                                       const Subject& subject) {
  if (subject.kind != SubjectKind::signal) return {};
  Hypothesis heat{material.name_of(subject),
                  Form::own_gains,
                  {{std::string(tau.name), material.lag_times_s(tau.low, tau.high, 22), true},
                   {std::string(power.name), {power.low, power.high}, false, true}},
                  {"gain_um_per_unit"}};
  const auto effect = [signal = material.values_of(subject)](ColumnOf room_K) {
    return [signal, room_K = std::move(room_K)](const MeasuredRun& run, const Shapes& shapes,
                                                std::size_t) {
      Panel all(run.rows(), (room_K ? 2 : 1) * std::ssize(shapes));
      Eigen::Index column = 0;
      for (const Shape& shape : shapes) {
        all.col(column++) = lagged(run.time_s, signal(run).array().pow(shape[1]), shape[0]);
        if (room_K) all.col(column++) = lagged(run.time_s, room_K(run), shape[0]);
      }
      return all;
    };
  };
  heat.effect = effect({});
  const std::optional<Subject> room = material.room();
  if (!room || room->kind != SubjectKind::other_temperature) return {std::move(heat)};
  Hypothesis with_room = heat;
  with_room.gains.emplace_back("gain_um_per_K");
  with_room.effect = effect(material.values_of(*room));
  with_room.log_prior = log_prior_of_room;
  with_room.simpler_cause = "missing_temperature";
  with_room.simpler_subject = material.name_of(*room);
  return {std::move(heat), std::move(with_room)};
}

double largest(const ThermalRuns& runs, std::size_t signal) {
  double most = 0.0;
  for (const ThermalRun& run : runs.runs)
    most = std::max(most, run.signals[signal].cwiseAbs().maxCoeff());
  return most;
}

/// A heat source driven by a signal at a place, which the network lacks.
std::vector<NetworkHypothesis> missing_heat_source_in_network(const NetworkMaterial& material,
                                                              const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::signal_at_place) return {};
  const std::size_t signal = subject.second;
  const NetworkPlace& place = material.plant.places[subject.index];
  const std::string& column = material.runs.signals[signal];
  const auto& runs = material.runs.runs;
  const auto& known = material.plant.source_names;
  const bool moves = std::any_of(runs.begin(), runs.end(), [&](const ThermalRun& run) {
    return run.signals[signal].maxCoeff() > run.signals[signal].minCoeff();
  });
  NetworkHypothesis heat;
  heat.hypothesis.subject = column + "|" + place.name;
  if (!moves || std::find(known.begin(), known.end(), heat.hypothesis.subject) != known.end())
    return {};
  heat.hypothesis.form = Form::shared_gain;
  heat.hypothesis.gains = {"heat_W"};
  heat.hypothesis.shape = {{std::string(power.name), {power.low, power.high}, false, true}};
  heat.hypothesis.bounds = [](std::size_t) { return Interval{0.0, 1e9}; };
  heat.at = largest(material.runs, signal);
  heat.apply = [&place, &column, at = heat.at](HeatNetwork& network, const Shape& shape,
                                               double gain) {
    network.sources.push_back({column, gain, at, shape[0], place.inflow});
  };
  return {std::move(heat)};
}

bool missing_heat_source_into_machine(MachineFile& machine, const std::string& subject,
                                      const std::vector<Parameter>& parameters) {
  machine.add_source(two_names(subject), shared_value(parameters, "heat_W"),
                     shared_value(parameters, "at"), shared_value(parameters, "power"));
  return true;
}

/// c LP(u^power) + K LP(T of the room): a heated body without a sensor.
Cause missing_heat_source() {
  Cause cause{"missing_heat_source", "heat"};
  cause.parameters = {
      tau,
      power,
      {.name = "gain_um_per_unit", .unit = "um/?", .description = "effect"},
      {.name = "gain_um_per_K", .unit = "um/K", .description = "effect of the room"},
      // In the thermal layer:
      {.name = "heat_W", .unit = "W", .low = 0.0, .description = "heat"},
      {.name = "at", .unit = "1", .low = 0.0, .description = "at a signal of"},
  };
  cause.texts = {"Heat that no sensor sees",
                 "the machine goes on moving after this signal changes: heat that no sensor sees",
                 "Use the extended model, or put a sensor where that heat enters."};
  cause.texts_in_network = {
      "Heat that the thermal model does not have",
      "this place warms with this signal: heat that the thermal model does not have",
      "Add a [[source]] with these figures, then look which motor, bearing or pump it is."};
  cause.experiment = Experiment::standstill;
  cause.hypotheses = missing_heat_source_hypotheses;
  cause.in_network = missing_heat_source_in_network;
  cause.into_machine = missing_heat_source_into_machine;
  return cause;
}

std::vector<Hypothesis> speed_growth_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::signal) return {};
  const auto unit = unit_of(material.name_of(subject)).suffix;
  if (unit != "_rpm" && unit != "_mm_per_min" && !unit.empty()) return {};
  Hypothesis growth{material.name_of(subject), Form::own_gains, {}, {"gain_um_per_unit2"}};
  growth.effect = [values = material.values_of(subject)](const MeasuredRun& run, const Shapes&,
                                                         std::size_t) -> Column {
    return values(run).array().square();
  };
  return {std::move(growth)};
}

/// c u^2 without lag: centrifugal growth, or the seat of a bearing.
Cause speed_growth() {
  Cause cause{"speed_growth", "heat"};
  cause.parameters = {{.name = "gain_um_per_unit2", .unit = "um/?^2", .description = "effect"}};
  cause.texts = {"Growth with speed, not with heat",
                 "the displacement jumps with the square of this signal",
                 "Use the extended model; this part is not thermal and no sensor will show it."};
  cause.texts_without_unit = cause.texts;
  cause.texts_without_unit->title = "Growth with the square of a signal, not with heat";
  cause.experiment = Experiment::standstill;
  cause.hypotheses = speed_growth_hypotheses;
  return cause;
}

}  // namespace

std::vector<Cause> of_heat() {
  return {missing_heat_source(), speed_growth()};
}

}  // namespace thermocomp::diagnosis::causes
