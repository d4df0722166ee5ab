/// Faults of readings.
#include <algorithm>

#include "config/runs/model_inputs.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

/// Latest onset of a fault, as a share of the run.
constexpr double last_onset = 0.95;

/// Common properties of faults of one reading in one run.
struct ReadingFault {
  const char* onset;  ///< name of the only shape parameter
  const char* gain;
  double first;  ///< first onset, as a share of the run
  std::size_t onsets;
  /// Error of a reading with a fault of gain 1 over all rows of the run [K], shape (rows, onsets).
  Panel (*error)(const MeasuredData& data, const MeasuredRun& run, std::size_t input,
                 const std::vector<double>& onsets_s);
};

/// The effect is minus the model's response to the error of the reading.
/// @pre the subject is an input in one run
Hypothesis of_reading_fault(const Material& material, const Subject& subject,
                            const ReadingFault& fault) {
  const MeasuredRun& run = material.data().runs[subject.run];
  Hypothesis of{material.name_of(subject),
                Form::shared_gain,
                {{fault.onset, material.onsets_s(subject.run, fault.first, last_onset, fault.onsets,
                                                 run.temps_K[subject.index])}},
                {fault.gain}};
  of.run = subject.run;
  of.sensor = subject.index;
  of.errors_K = [&material, input = subject.index, error = fault.error](const MeasuredRun& faulty,
                                                                        const Shapes& shapes) {
    return error(material.data(), faulty, input, firsts_of(shapes));
  };
  of.effect = [&material, input = subject.index, errors_K = of.errors_K](
                  const MeasuredRun& faulty, const Shapes& shapes, std::size_t output) -> Panel {
    return -answer_to_errors(material.data(), faulty, output, input, errors_K(faulty, shapes));
  };
  return of;
}

/// A fault of a sensor of a thermal network in one run; it changes only this reading.
/// @param value  error for a gain of 1 at a time
/// @pre the subject is a sensor in one run
NetworkHypothesis of_reading_in_network(
    const NetworkMaterial& material, const NetworkSubject& subject, const char* gain,
    std::function<double(double time_s, const Shape& shape)> value) {
  NetworkHypothesis of;
  of.hypothesis.subject = material.plant.network.sensors[subject.index].column;
  of.hypothesis.gains = {gain};
  of.hypothesis.output = subject.index;
  of.hypothesis.run = subject.second;
  of.fault = [&rows = material.rows, run = subject.second,
              value = std::move(value)](const Shape& shape) {
    Column column = Column::Zero(rows.time_s.size());
    for (Eigen::Index row = rows.runs[run].begin; row < rows.runs[run].end; ++row)
      column[row] = value(rows.time_s[row], shape);
    return column;
  };
  return of;
}

constexpr std::size_t onsets_in_network = 48;

/// 1 K from the onset on.
Panel step_errors_K(const MeasuredData&, const MeasuredRun& run, std::size_t,
                    const std::vector<double>& onsets_s) {
  return since(run.time_s, onsets_s);
}

std::vector<Hypothesis> sensor_step_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  return {of_reading_fault(material, subject, {"at_s", "step_K", 0.02, 52, step_errors_K})};
}

/// Onsets are evenly distributed over the run.
std::vector<NetworkHypothesis> sensor_step_in_network(const NetworkMaterial& material,
                                                      const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor_in_run) return {};
  NetworkHypothesis step = of_reading_in_network(
      material, subject, "step_K",
      [](double time_s, const Shape& shape) { return time_s >= shape[0] ? 1.0 : 0.0; });
  const Block& block = material.rows.runs[subject.second];
  const double first_s = material.rows.time_s[block.begin];
  const double last_s = material.rows.time_s[block.end - 1];
  std::vector<double> onsets_s = linear_grid(first_s, last_s, onsets_in_network + 2);
  step.hypothesis.shape = {{"at_s", {onsets_s.begin() + 1, onsets_s.end() - 1}}};
  return {std::move(step)};
}

/// A reading jumps in a run and stays.
Cause sensor_step() {
  Cause cause{"sensor_step", "sensor"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .description = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "step_K", .unit = "K", .description = "jump", .of_a_jump = true}};
  cause.texts = {
      "A reading jumped", "this reading jumped and stayed",
      "Look at the connector and the amplifier's channel; leave the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = sensor_step_hypotheses;
  cause.in_network = sensor_step_in_network;
  return cause;
}

/// Time since the onset [h], for a gain in K/h.
Panel drift_errors_h(const MeasuredData&, const MeasuredRun& run, std::size_t,
                     const std::vector<double>& onsets_s) {
  Panel all(run.rows(), std::ssize(onsets_s));
  for (Eigen::Index i = 0; i < all.cols(); ++i)
    all.col(i) =
        ((run.time_s.array() - onsets_s[static_cast<std::size_t>(i)]) / 3600.0).max(0.0).matrix();
  return all;
}

std::vector<Hypothesis> sensor_drift_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  return {
      of_reading_fault(material, subject, {"start_s", "rate_K_per_h", 0.0, 24, drift_errors_h})};
}

/// From the run's start on.
std::vector<NetworkHypothesis> sensor_drift_in_network(const NetworkMaterial& material,
                                                       const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor_in_run) return {};
  const double first_s = material.rows.time_s[material.rows.runs[subject.second].begin];
  return {of_reading_in_network(
      material, subject, "rate_K_per_h",
      [first_s](double time_s, const Shape&) { return (time_s - first_s) / 3600.0; })};
}

/// A reading creeps in a run.
Cause sensor_drift() {
  Cause cause{"sensor_drift", "sensor"};
  cause.parameters = {{.name = "start_s", .unit = "s", .description = "creeps from"},
                      {.name = "rate_K_per_h", .unit = "K/h", .description = "creep"}};
  cause.texts = {"A reading creeps",
                 "this reading creeps away from what its neighbours and the displacement say",
                 "Replace or calibrate the sensor; leave the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = sensor_drift_hypotheses;
  cause.in_network = sensor_drift_in_network;
  return cause;
}

/// Range of 1 / gain - 1, the lost share of the motion over the remaining one.
constexpr double lost_min = 0.02;
constexpr double lost_max = 20.0;

double kept(double lost) {
  return 1.0 / (1.0 + lost);
}

/// reading = room + gain (T - room): the reading misses (1 / gain - 1) (reading - room),
/// from the onset on. Without a column of the room, the reading's first value replaces it.
Panel loose_errors_K(const MeasuredData& data, const MeasuredRun& run, std::size_t input,
                     const std::vector<double>& onsets_s) {
  const auto temps_degC = [&run](std::size_t place) -> Column {
    return run.temps_K[place].array() + run.reference_degC[place];
  };
  const Column reading_degC = temps_degC(input);
  const std::optional<std::size_t> room = room_among(data);
  const Column room_degC = room ? temps_degC(*room) : Column::Constant(run.rows(), reading_degC[0]);
  return (room_degC - reading_degC).asDiagonal() * since(run.time_s, onsets_s);
}

std::vector<Hypothesis> sensor_loose_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  if (is_called_like_a_room(material.name_of(subject))) return {};
  Hypothesis loose =
      of_reading_fault(material, subject, {"at_s", "gain", 0.03, 40, loose_errors_K});
  loose.bounds = [](std::size_t) { return Interval{lost_min, lost_max}; };
  loose.shrinks_reading = true;
  return {std::move(loose)};
}

/// Converts the lost share to the gain.
std::vector<Parameter> gain_left(const FoundGains& found) {
  const std::size_t output = first_output(found);
  const Interval& lost = found.ci95[output].front();
  return {{"gain",
           {{"", kept(found.gains[output][0])}},
           {{"", {kept(lost.high), kept(std::max(lost.low, lost_min))}}}}};
}

/// From a time on the reading is room + gain (T - room).
Cause sensor_loose() {
  Cause cause{"sensor_loose", "sensor"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .description = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "gain",
                       .unit = "1",
                       .low = kept(lost_max),
                       .high = kept(lost_min),
                       .description = "of its motion left:"}};
  cause.texts = {"A sensor has come loose",
                 "from a time on this sensor shows more of the room than of its place",
                 "Fasten the sensor; leave the rest of the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = sensor_loose_hypotheses;
  cause.gains = gain_left;
  return cause;
}

Hypothesis exchanged(const Material& material, std::size_t input, std::size_t other) {
  const MeasuredData& data = material.data();
  Hypothesis swap{data.model.inputs[input] + "|" + data.model.inputs[other], Form::no_gain};
  swap.effect = [&data, input, other](const MeasuredRun& run, const Shapes&,
                                      std::size_t output) -> Panel {
    const Panel more_K = run.denoised_K[other] - run.denoised_K[input];
    return answer_to_errors(data, run, output, input, more_K) +
           answer_to_errors(data, run, output, other, -more_K);
  };
  return swap;
}

/// Pairs the subject with each input later in the alphabet.
std::vector<Hypothesis> sensor_swap_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  const auto& inputs = material.data().model.inputs;
  std::vector<Hypothesis> all;
  for (std::size_t other = 0; other < inputs.size(); ++other)
    if (inputs[subject.index] < inputs[other])
      all.push_back(exchanged(material, subject.index, other));
  return all;
}

/// Exchanged channels: the coefficient of each is applied to the temperature of the other.
Cause sensor_swap() {
  Cause cause{"sensor_swap", "sensor"};
  cause.texts = {"Two channels are exchanged", "these two channels are exchanged",
                 "Exchange the two plugs or the two names in the configuration."};
  cause.experiment = Experiment::steady_levels;
  cause.hypotheses = sensor_swap_hypotheses;
  return cause;
}

}  // namespace

std::vector<Cause> of_sensor() {
  return {sensor_step(), sensor_drift(), sensor_loose(), sensor_swap()};
}

}  // namespace thermocomp::diagnosis::causes
