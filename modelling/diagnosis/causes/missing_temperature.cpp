#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "missing_temperature";
constexpr CauseParameter tau{"tau_s", "s", 0.0, 6 * 3600.0, "time constant"};
constexpr double shortest_lag_s = 60.0;

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::other_temperature) return {};
  std::vector<double> taus_s = material.lag_times_s(shortest_lag_s, tau.high, 20);
  taus_s.insert(taus_s.begin(), tau.low);
  Hypothesis missing{name,
                     material.name_of(subject),
                     Form::own_gains,
                     {{std::string(tau.name), taus_s, true}},
                     {"gain_um_per_K"}};
  missing.columns = [&material, rise_K = material.values_of(subject)](const Shapes& shapes,
                                                                      std::size_t) {
    return material.stacked(
        [&](const MeasuredRun& run) { return lagged(run.time_s, rise_K(run), firsts_of(shapes)); });
  };
  return {std::move(missing)};
}

}  // namespace

/// K LP(T) of a place that the model does not use; tau = 0: K T.
Cause missing_temperature() {
  Cause cause{name, "structure"};
  cause.parameters = {tau, {.name = "gain_um_per_K", .unit = "um/K", .says = "effect"}};
  cause.texts = {
      "A measured place that the model leaves out",
      "a measured place that the model ignores moves the machine",
      "Use the extended model, or take this place into the model when it is fitted again."};
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gain_of_each_output;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
