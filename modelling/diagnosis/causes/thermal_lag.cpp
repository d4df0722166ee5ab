#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "thermal_lag";
constexpr CauseParameter tau{"tau_s", "s", 60.0, 4 * 3600.0, "time constant"};
/// The share of a place's effect that may be late: a fit settles it hardly better than this.
constexpr double share_max = 1.1;

/// Of gains, as a share of what the input or its whole group does in the end.
std::function<Interval(std::size_t output)> shares_of(const Material& material, std::size_t input) {
  return [&material, input](std::size_t output) {
    const auto row = static_cast<Eigen::Index>(output);
    const auto column = static_cast<Eigen::Index>(input);
    const double own = share_max * material.settled_um_per_K()(row, column);
    const double of_group = share_max * material.settled_of_group_um_per_K()(row, column);
    return Interval{std::min({0.0, own, of_group}), std::max({0.0, own, of_group})};
  };
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis lag{name,
                 material.name_of(subject),
                 Form::own_gains,
                 {{std::string(tau.name), material.lag_times_s(tau.low, tau.high, 20), true}},
                 {"gain_um_per_K"}};
  lag.columns = [&material, rise_K = material.values_of(subject)](const Shapes& shapes,
                                                                  std::size_t) {
    return material.stacked([&](const MeasuredRun& run) -> Panel {
      return lagged(run.time_s, rise_K(run), firsts_of(shapes)).colwise() - rise_K(run);
    });
  };
  if (material.data().model.guideways.empty()) lag.bounds = shares_of(material, subject.index);
  return {std::move(lag)};
}

}  // namespace

/// g (LP(T) - T), 0 < g / K <= 1: a share of the structure follows late.
Cause thermal_lag() {
  Cause cause{name, "structure"};
  cause.parameters = {tau, {.name = "gain_um_per_K", .unit = "um/K", .says = "effect"}};
  cause.texts = {
      "Part of the structure follows late", "a part of the structure follows this temperature late",
      "Use the extended model; a sensor deeper in the slow part would make it unnecessary."};
  cause.experiment = Experiment::up_and_down;
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gain_of_each_output;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
