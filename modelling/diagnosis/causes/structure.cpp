/// Errors of the relation between temperatures and displacement.
#include <algorithm>

#include "config/text/units.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

std::vector<Hypothesis> wrong_coefficient_hypotheses(const Material& material,
                                                     const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis wrong{material.name_of(subject), Form::own_gains, {}, {"delta_um_per_K"}};
  wrong.effect = [rise_K = material.values_of(subject)](const MeasuredRun& run, const Shapes&,
                                                        std::size_t) { return rise_K(run); };
  return {std::move(wrong)};
}

/// dK T: the coefficient of a place is wrong by dK.
Cause wrong_coefficient() {
  Cause cause{"wrong_coefficient", "structure"};
  cause.parameters = {
      {.name = "delta_um_per_K", .unit = "um/K", .description = "the coefficient lacks"}};
  cause.texts = {
      "The effect of a place has another size",
      "the model moves by the wrong amount for each kelvin of this place",
      "Use the extended model; look at the support or material that the coefficient came from."};
  cause.experiment = Experiment::steady_levels;
  cause.hypotheses = wrong_coefficient_hypotheses;
  return cause;
}

constexpr CauseParameter lag_tau{"tau_s", "s", 60.0, 4 * 3600.0, "time constant"};
/// Upper bound on the late share of a place's effect; above 1 since a fit has errors.
constexpr double share_max = 1.1;

/// Bounds of the gain, from the steady-state effect of the input or its whole group.
std::function<Interval(std::size_t output)> lag_shares_of(const Material& material,
                                                          std::size_t input) {
  return [&material, input](std::size_t output) {
    const auto row = static_cast<Eigen::Index>(output);
    const auto column = static_cast<Eigen::Index>(input);
    const double own = share_max * material.settled_um_per_K()(row, column);
    const double of_group = share_max * material.settled_of_group_um_per_K()(row, column);
    return Interval{std::min({0.0, own, of_group}), std::max({0.0, own, of_group})};
  };
}

std::vector<Hypothesis> thermal_lag_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis lag{
      material.name_of(subject),
      Form::own_gains,
      {{std::string(lag_tau.name), material.lag_times_s(lag_tau.low, lag_tau.high, 20), true}},
      {"gain_um_per_K"}};
  lag.effect = [rise_K = material.values_of(subject)](const MeasuredRun& run, const Shapes& shapes,
                                                      std::size_t) -> Panel {
    return lagged(run.time_s, rise_K(run), firsts_of(shapes)).colwise() - rise_K(run);
  };
  if (material.data().model.guideways.empty()) lag.bounds = lag_shares_of(material, subject.index);
  return {std::move(lag)};
}

/// g (LP(T) - T), 0 < g / K <= 1: a share of the structure lags.
Cause thermal_lag() {
  Cause cause{"thermal_lag", "structure"};
  cause.parameters = {lag_tau, {.name = "gain_um_per_K", .unit = "um/K", .description = "effect"}};
  cause.texts = {
      "Part of the structure follows late", "a part of the structure follows this temperature late",
      "Use the extended model; a sensor deeper in the slow part would make it unnecessary."};
  cause.experiment = Experiment::up_and_down;
  cause.hypotheses = thermal_lag_hypotheses;
  return cause;
}

constexpr CauseParameter missing_tau{"tau_s", "s", 0.0, 6 * 3600.0, "time constant"};
constexpr double shortest_lag_s = 60.0;

std::vector<Hypothesis> missing_temperature_hypotheses(const Material& material,
                                                       const Subject& subject) {
  if (subject.kind != SubjectKind::other_temperature) return {};
  std::vector<double> taus_s = material.lag_times_s(shortest_lag_s, missing_tau.high, 20);
  taus_s.insert(taus_s.begin(), missing_tau.low);
  Hypothesis missing{material.name_of(subject),
                     Form::own_gains,
                     {{std::string(missing_tau.name), taus_s, true}},
                     {"gain_um_per_K"}};
  missing.effect = [rise_K = material.values_of(subject)](const MeasuredRun& run,
                                                          const Shapes& shapes, std::size_t) {
    return lagged(run.time_s, rise_K(run), firsts_of(shapes));
  };
  return {std::move(missing)};
}

/// K LP(T) of a place that the model does not use; missing_tau = 0: K T.
Cause missing_temperature() {
  Cause cause{"missing_temperature", "structure"};
  cause.parameters = {missing_tau,
                      {.name = "gain_um_per_K", .unit = "um/K", .description = "effect"}};
  cause.texts = {
      "A measured place that the model leaves out",
      "a measured place that the model ignores moves the machine",
      "Use the extended model, or take this place into the model when it is fitted again."};
  cause.hypotheses = missing_temperature_hypotheses;
  return cause;
}

std::vector<Hypothesis> nonlinear_expansion_hypotheses(const Material& material,
                                                       const Subject& subject) {
  if (subject.kind != SubjectKind::input && subject.kind != SubjectKind::other_temperature)
    return {};
  Hypothesis square{material.name_of(subject), Form::own_gains, {}, {"gain_um_per_K2"}};
  square.effect = [rise_K = material.values_of(subject)](const MeasuredRun& run, const Shapes&,
                                                         std::size_t) -> Column {
    return rise_K(run).array().square();
  };
  return {std::move(square)};
}

/// c T^2.
Cause nonlinear_expansion() {
  Cause cause{"nonlinear_expansion", "structure"};
  cause.parameters = {{.name = "gain_um_per_K2", .unit = "um/K^2", .description = "curvature"}};
  cause.texts = {
      "The effect of a temperature is curved", "the effect of this temperature is curved",
      "Use the extended model; beyond the temperatures seen here the curve is not known."};
  cause.experiment = Experiment::steady_levels;
  cause.hypotheses = nonlinear_expansion_hypotheses;
  return cause;
}

Hypothesis along_axis(const Material& material, const Subject& place, const Subject& position) {
  const std::string& temperature = material.name_of(place);
  const std::string& axis = material.name_of(position);
  const std::string subject = std::min(temperature, axis) + "|" + std::max(temperature, axis);
  Hypothesis along{subject, Form::own_gains, {}, {"gain_um_per_K_mm", "p0_mm"}};
  along.simpler_cause =
      place.kind == SubjectKind::input ? "wrong_coefficient" : "missing_temperature";
  along.simpler_subject = temperature;  // without the position
  along.effect = [rise_K = material.values_of(place), position_mm = material.values_of(position)](
                     const MeasuredRun& run, const Shapes&, std::size_t) {
    Panel both(run.rows(), 2);
    both << position_mm(run).cwiseProduct(rise_K(run)), rise_K(run);
    return both;
  };
  return along;
}

/// One hypothesis per position that moves.
std::vector<Hypothesis> position_dependence_hypotheses(const Material& material,
                                                       const Subject& subject) {
  if (subject.kind != SubjectKind::input && subject.kind != SubjectKind::other_temperature)
    return {};
  std::vector<Hypothesis> all;
  const auto& signals = material.data().signals;
  for (std::size_t signal = 0; signal < signals.size(); ++signal) {
    const Subject position{SubjectKind::signal, signal};
    if (kind_of(signals[signal]) != QuantityKind::position) continue;
    if (!material.moves_anywhere(material.values_of(position))) continue;
    all.push_back(along_axis(material, subject, position));
  }
  return all;
}

/// p0 of c (p - p0) T = c p T + b T, that is -b / c; mean over the outputs weighted by c^2.
double pivot(const FoundGains& found) {
  double above = 0.0;
  double below = 0.0;
  for (const Eigen::VectorXd& gains : found.gains) {
    if (gains.size() == 0) continue;
    above -= gains[0] * gains[1];
    below += gains[0] * gains[0];
  }
  return below > 0 ? above / below : 0.0;
}

std::vector<Parameter> gains_along(const FoundGains& found) {
  return {gain_table(found, 0), {"p0_mm", {{"", pivot(found)}}, {}}};
}

/// c (p - p0) T: the effect of a temperature grows along an axis.
Cause position_dependence() {
  Cause cause{"position_dependence", "structure"};
  cause.parameters = {
      {.name = "gain_um_per_K_mm", .unit = "um/(K mm)", .description = "effect along the axis"},
      {.name = "p0_mm", .unit = "mm", .description = "none at"}};
  cause.texts = {"The effect grows along the axis",
                 "the effect of this temperature grows along the axis",
                 "Use the extended model, or give the model a guideway along this axis."};
  cause.experiment = Experiment::along_the_axis;
  cause.hypotheses = position_dependence_hypotheses;
  cause.gains = gains_along;
  return cause;
}

constexpr CauseParameter start_tau{"tau_s", "s", 0.0, 6 * 3600.0, "time constant"};
constexpr CauseParameter at_start{"at_start", "1", 0.0, 1.0, "by the start (1) or by now (0):"};
/// Least number and range of the runs' initial temperatures.
constexpr std::size_t starts_min = 3;
constexpr double starts_apart_K = 1.0;
/// Gains are fitted about this initial temperature.
constexpr double usual_degC = 20.0;

bool starts_differ(const MeasuredData& data, std::size_t place) {
  std::vector<double> starts_degC;
  for (const MeasuredRun& run : data.runs) starts_degC.push_back(run.reference_degC[place]);
  const auto [least, most] = std::minmax_element(starts_degC.begin(), starts_degC.end());
  return starts_degC.size() >= starts_min && *most - *least >= starts_apart_K;
}

/// @param now  rise of the place if its present temperature counts; empty: that at the start
Hypothesis by_start(const Material& material, const Subject& subject, std::size_t place,
                    const ColumnOf& now) {
  const bool is_signal = subject.kind == SubjectKind::signal;
  Hypothesis by{material.name_of(subject) + "|" + material.data().temperatures[place],
                Form::own_gains,
                {{std::string(start_tau.name), {0.0}, false, true},
                 {std::string(at_start.name), {1.0}, false, true}},
                {"gain_um_per_unit_K", "place0_degC"}};
  if (is_signal) {
    by.shape[0] = {std::string(start_tau.name),
                   material.lag_times_s(shortest_lag_s, start_tau.high, 12), true};
    by.shape[0].grid.insert(by.shape[0].grid.begin(), start_tau.low);
  }
  if (now) by.shape[1].grid = {0.0};
  by.simpler_cause = is_signal ? "missing_heat_source" : "wrong_coefficient";
  by.simpler_subject = material.name_of(subject);
  by.effect = [place, now, values = material.values_of(subject)](
                  const MeasuredRun& run, const Shapes& shapes, std::size_t) {
    const Panel late = lagged(run.time_s, values(run), firsts_of(shapes));
    Column above_K = Column::Constant(run.rows(), run.reference_degC[place] - usual_degC);
    if (now) above_K += now(run);
    Panel all(run.rows(), 2 * late.cols());
    for (Eigen::Index i = 0; i < late.cols(); ++i) {
      all.col(2 * i) = above_K.cwiseProduct(late.col(i));
      all.col(2 * i + 1) = late.col(i);
    }
    return all;
  };
  return by;
}

/// Depends on the place itself (for a signal: on the model's first input) or on the room.
std::vector<Hypothesis> start_dependence_hypotheses(const Material& material,
                                                    const Subject& subject) {
  if (subject.kind != SubjectKind::input && subject.kind != SubjectKind::signal) return {};
  const MeasuredData& data = material.data();
  const std::size_t first = subject.kind == SubjectKind::input ? subject.index : 0;
  std::vector<Hypothesis> all;
  if (starts_differ(data, first)) all.push_back(by_start(material, subject, first, {}));
  const std::optional<Subject> room = material.room();
  if (room && room->index != first && starts_differ(data, room->index))
    all.push_back(by_start(material, subject, room->index, material.values_of(*room)));
  return all;
}

std::vector<Parameter> gains_by_start(const FoundGains& found) {
  return {gain_table(found, 0), {"place0_degC", {{"", usual_degC + pivot(found)}}, {}}};
}

/// g (X - X0) LP(u), X at the start or now: [a1 + a2 T0 + a3 T1] dT and
/// N [b1 + b2 T0 + b3 T1] LP(1) of JP7689460B2.
Cause start_dependence() {
  Cause cause{"start_dependence", "structure"};
  cause.parameters = {start_tau,
                      at_start,
                      {.name = "gain_um_per_unit_K", .unit = "um/(? K)", .description = "effect"},
                      {.name = "place0_degC", .unit = "degC", .description = "none at"}};
  cause.texts = {"An effect depends on how the day began",
                 "its effect depends on the second temperature: where that stood at the start, or "
                 "stands now",
                 "Use the extended model; runs of days that begin colder and warmer settle it."};
  cause.hypotheses = start_dependence_hypotheses;
  cause.gains = gains_by_start;
  return cause;
}

constexpr CauseParameter sensor_tau{"tau_s", "s", 20.0, 3600.0, "time constant"};
/// Time constant of smoothing before differentiation, as a share of the sensor's.
constexpr double slope_smoothing = 0.25;

std::vector<Hypothesis> slow_sensor_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis slow{material.name_of(subject),
                  Form::no_gain,
                  {{std::string(sensor_tau.name),
                    material.lag_times_s(sensor_tau.low, sensor_tau.high, 16), true}}};
  slow.effect = [&material, input = subject.index](const MeasuredRun& run, const Shapes& shapes,
                                                   std::size_t output) {
    // A late reading is too low by sensor_tau times its slope.
    Panel missed_K(run.rows(), std::ssize(shapes));
    for (std::size_t i = 0; i < shapes.size(); ++i)
      missed_K.col(static_cast<Eigen::Index>(i)) =
          shapes[i][0] * slope(run.time_s, run.temps_K[input], slope_smoothing * shapes[i][0]);
    return answer_to_errors(material.data(), run, output, input, missed_K);
  };
  return {std::move(slow)};
}

constexpr double shortest_in_network_s = 30.0;

std::vector<NetworkHypothesis> slow_sensor_in_network(const NetworkMaterial& material,
                                                      const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor) return {};
  NetworkHypothesis slow;
  slow.hypothesis.subject = material.plant.network.sensors[subject.index].column;
  slow.hypothesis.form = Form::no_gain;
  slow.hypothesis.shape = {{std::string(sensor_tau.name),
                            logarithmic_grid(shortest_in_network_s, sensor_tau.high, 12), true,
                            false}};
  slow.hypothesis.output = subject.index;
  slow.apply = [sensor = subject.index](HeatNetwork& network, const Shape& shape, double gain) {
    network.sensors[sensor].lag_s += gain * shape[0];
  };
  return {std::move(slow)};
}

bool slow_sensor_into_machine(MachineFile& machine, const std::string& subject,
                              const std::vector<Parameter>& parameters) {
  return machine.add_to_thermocouple(subject.substr(0, subject.rfind("_degC")), "lag_s",
                                     shared_value(parameters, "tau_s"));
}

/// The reading is LP(T): the displacement leads it.
Cause slow_sensor() {
  Cause cause{"slow_sensor", "structure"};
  cause.parameters = {sensor_tau};
  cause.texts = {
      "A sensor follows its place late",
      "the displacement leads the reading: the sensor follows its place late",
      "Look at how the sensor is mounted (paste, clamp, tape); until then use the extended model."};
  cause.experiment = Experiment::up_and_down;
  cause.hypotheses = slow_sensor_hypotheses;
  cause.in_network = slow_sensor_in_network;
  cause.into_machine = slow_sensor_into_machine;
  return cause;
}

std::vector<Hypothesis> play_of_input(const Material& material, const Subject& subject) {
  const double range_K =
      material.range([input = subject.index](const MeasuredRun& run) -> const Column& {
        return run.temps_K[input];
      });
  Hypothesis play{material.name_of(subject),
                  Form::no_gain,
                  {{"width_K", linear_grid(0.04 * range_K, 0.8 * range_K, 16)}}};
  play.effect = [&material, input = subject.index](const MeasuredRun& run, const Shapes& shapes,
                                                   std::size_t output) {
    return answer_to_errors(material.data(), run, output, input,
                            played_less_values(run.denoised_K[input], firsts_of(shapes)));
  };
  return {std::move(play)};
}

std::vector<Hypothesis> play_of_output(const Material& material, const Subject& subject) {
  const double range_um =
      material.range([output = subject.index](const MeasuredRun& run) -> const Column& {
        return run.model_um[output];
      });
  if (!(range_um > 0)) return {};
  Hypothesis play{material.name_of(subject),
                  Form::no_gain,
                  {{"width_um", linear_grid(0.03 * range_um, 0.7 * range_um, 20)}}};
  play.output = subject.index;
  play.effect = [](const MeasuredRun& run, const Shapes& shapes, std::size_t output) {
    return played_less_values(denoised(run.time_s, run.model_um[output]), firsts_of(shapes));
  };
  return {std::move(play)};
}

std::vector<Hypothesis> hysteresis_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind == SubjectKind::input) return play_of_input(material, subject);
  if (subject.kind == SubjectKind::output) return play_of_output(material, subject);
  return {};
}

/// Play of one temperature's effect or of the whole output: a loop that does not depend on speed.
Cause hysteresis() {
  Cause cause{"hysteresis", "structure"};
  cause.parameters = {{.name = "width_K", .unit = "K", .low = 0.0, .description = "dead band"},
                      {.name = "width_um", .unit = "um", .low = 0.0, .description = "dead band"}};
  cause.texts = {
      "Something sticks before it follows",
      "what moves sticks before it follows: a loop that does not depend on speed",
      "Look for a joint or a clamp that slips; the extended model carries it until then."};
  cause.experiment = Experiment::twice_as_slow;
  cause.hypotheses = hysteresis_hypotheses;
  return cause;
}

}  // namespace

std::vector<Cause> of_structure() {
  return {wrong_coefficient(),   thermal_lag(),      missing_temperature(), nonlinear_expansion(),
          position_dependence(), start_dependence(), slow_sensor(),         hysteresis()};
}

}  // namespace thermocomp::diagnosis::causes
