#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "thermal_lag";
constexpr CauseParameter tau{"tau_s", "s", 60.0, 4 * 3600.0, "time constant"};
/// The share of a place's effect that may be late: a fit settles it hardly better than this.
constexpr double share_max = 1.1;

/// A share of what the input or its whole group does in the end.
std::function<bool(double gain, std::size_t output)> possible(const Material& material,
                                                              const Subject& subject) {
  const auto& inputs = material.data().model.inputs;
  // Of places that move alike a fit settles the sum, hardly each coefficient.
  const Eigen::MatrixXd& settled_um_per_K = material.settled_um_per_K();
  Eigen::VectorXd of_group_um_per_K = Eigen::VectorXd::Zero(settled_um_per_K.rows());
  for (std::size_t other = 0; other < inputs.size(); ++other)
    if (same_places(material.groups(), inputs[subject.index], inputs[other]))
      of_group_um_per_K += settled_um_per_K.col(static_cast<Eigen::Index>(other));
  return [&settled_um_per_K, of_group_um_per_K, input = subject.index](double gain,
                                                                       std::size_t output) {
    const auto row = static_cast<Eigen::Index>(output);
    const double own = gain / settled_um_per_K(row, static_cast<Eigen::Index>(input));
    const double of_group = gain / of_group_um_per_K[row];
    return (own > 0.0 && own <= share_max) || (of_group > 0.0 && of_group <= share_max);
  };
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis lag{name,
                 material.name_of(subject),
                 Form::own_gains,
                 {{std::string(tau.name), material.lag_times_s(tau.low, tau.high, 20), true}},
                 {"gain_um_per_K"}};
  lag.write_columns = [&material, rise_K = material.values_of(subject)](
                          const Shapes& shapes, std::size_t, PanelPart into) {
    material.write_stacked(
        into, [&, taus_s = firsts_of(shapes)](const MeasuredRun& run, PanelPart of_run) {
          lagged_less_values(run.time_s, rise_K(run), taus_s, of_run);
        });
  };
  if (material.data().model.guideways.empty()) lag.possible = possible(material, subject);
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
