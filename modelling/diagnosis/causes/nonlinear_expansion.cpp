#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "nonlinear_expansion";

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input && subject.kind != SubjectKind::other_temperature)
    return {};
  Hypothesis square{name, material.name_of(subject), Form::own_gains, {}, {"gain_um_per_K2"}};
  square.columns = [&material, rise_K = material.values_of(subject)](const Shapes&, std::size_t) {
    return material.stacked(
        [&](const MeasuredRun& run) -> Column { return rise_K(run).array().square(); });
  };
  return {std::move(square)};
}

}  // namespace

/// c T^2.
Cause nonlinear_expansion() {
  Cause cause{name, "structure"};
  cause.parameters = {{.name = "gain_um_per_K2", .unit = "um/K^2", .says = "curvature"}};
  cause.texts = {
      "The effect of a temperature is curved", "the effect of this temperature is curved",
      "Use the extended model; beyond the temperatures seen here the curve is not known."};
  cause.experiment = Experiment::steady_levels;
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gain_of_each_output;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
