#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_coefficient";

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis wrong{name, material.name_of(subject), Form::own_gains, {}, {"delta_um_per_K"}};
  wrong.columns = [&material, rise_K = material.values_of(subject)](const Shapes&, std::size_t) {
    return material.stacked(rise_K);
  };
  return {std::move(wrong)};
}

}  // namespace

/// dK T: the coefficient of a place is off by dK.
Cause wrong_coefficient() {
  Cause cause{name, "structure"};
  cause.parameters = {{.name = "delta_um_per_K", .unit = "um/K", .says = "the coefficient lacks"}};
  cause.texts = {
      "The effect of a place has another size",
      "the model moves by the wrong amount for each kelvin of this place",
      "Use the extended model; look at the support or material that the coefficient came from."};
  cause.experiment = Experiment::steady_levels;
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gain_of_each_output;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
