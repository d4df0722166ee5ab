#include "config/text/units.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "speed_growth";

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::signal) return {};
  const auto unit = unit_of(material.name_of(subject)).suffix;
  if (unit != "_rpm" && unit != "_mm_per_min" && !unit.empty()) return {};
  Hypothesis growth{name, material.name_of(subject), Form::own_gains, {}, {"gain_um_per_unit2"}};
  growth.columns = [&material, values = material.values_of(subject)](const Shapes&, std::size_t) {
    return material.stacked(
        [&](const MeasuredRun& run) -> Column { return values(run).array().square(); });
  };
  return {std::move(growth)};
}

}  // namespace

/// c u^2 at once: centrifugal, or the seat of a bearing.
Cause speed_growth() {
  Cause cause{name, "heat"};
  cause.parameters = {{.name = "gain_um_per_unit2", .unit = "um/?^2", .says = "effect"}};
  cause.texts = {"Growth with speed, not with heat",
                 "the displacement jumps with the square of this signal",
                 "Use the extended model; this part is not thermal and no sensor will show it."};
  cause.texts_without_unit = cause.texts;
  cause.texts_without_unit->title = "Growth with the square of a signal, not with heat";
  cause.experiment = Experiment::standstill;
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gain_of_each_output;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
