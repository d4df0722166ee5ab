#include "modelling/diagnosis/causes/reading_fault.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "sensor_drift";

/// Time since the onset [h], for a gain in K/h.
Panel errors_h(const MeasuredData&, const MeasuredRun& run, std::size_t,
               const std::vector<double>& onsets_s) {
  Panel all(run.rows(), std::ssize(onsets_s));
  for (Eigen::Index i = 0; i < all.cols(); ++i)
    all.col(i) =
        ((run.time_s.array() - onsets_s[static_cast<std::size_t>(i)]) / 3600.0).max(0.0).matrix();
  return all;
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  return {
      of_reading_fault(material, subject, {name, "start_s", "rate_K_per_h", 0.0, 24, errors_h})};
}

/// From the run's start on.
std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor_in_run) return {};
  const double first_s = material.rows.time_s[material.rows.runs[subject.second].begin];
  return {of_reading_in_network(
      material, subject, name, "rate_K_per_h",
      [first_s](double time_s, const Shape&) { return (time_s - first_s) / 3600.0; })};
}

}  // namespace

/// A reading creeps in a run.
Cause sensor_drift() {
  Cause cause{name, "sensor"};
  cause.parameters = {{.name = "start_s", .unit = "s", .says = "creeps from"},
                      {.name = "rate_K_per_h", .unit = "K/h", .says = "creep"}};
  cause.texts = {"A reading creeps",
                 "this reading creeps away from what its neighbours and the displacement say",
                 "Replace or calibrate the sensor; leave the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = of;
  cause.gains = single_gain;
  cause.in_network = in_network;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
