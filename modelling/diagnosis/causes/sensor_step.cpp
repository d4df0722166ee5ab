#include "modelling/diagnosis/causes/reading_fault.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "sensor_step";
constexpr std::size_t onsets_in_network = 48;

/// 1 K from the onset on.
Panel errors_K(const MeasuredData&, const MeasuredRun& run, std::size_t,
               const std::vector<double>& onsets_s) {
  return since(run.time_s, onsets_s);
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  return {of_reading_fault(material, subject, {name, "at_s", "step_K", 0.02, 52, errors_K})};
}

/// A jump at any of many moments.
std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor_in_run) return {};
  NetworkHypothesis step = of_reading_in_network(
      material, subject, name, "step_K",
      [](double time_s, const Shape& shape) { return time_s >= shape[0] ? 1.0 : 0.0; });
  step.hypothesis.shape = {{"at_s", inner_times_s(material, subject.second, onsets_in_network)}};
  return {std::move(step)};
}

}  // namespace

/// A reading jumps in a run and stays.
Cause sensor_step() {
  Cause cause{name, "sensor"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .says = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "step_K", .unit = "K", .says = "jump", .of_a_jump = true}};
  cause.texts = {
      "A reading jumped", "this reading jumped and stayed",
      "Look at the connector and the amplifier's channel; leave the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = of;
  cause.gains = single_gain;
  cause.in_network = in_network;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
