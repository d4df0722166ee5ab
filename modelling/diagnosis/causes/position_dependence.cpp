#include <algorithm>

#include "config/text/units.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "position_dependence";

Hypothesis along(const Material& material, const Subject& place, const Subject& position) {
  const std::string& temperature = material.name_of(place);
  const std::string& axis = material.name_of(position);
  const std::string subject = std::min(temperature, axis) + "|" + std::max(temperature, axis);
  Hypothesis along{name, subject, Form::own_gains, {}, {"gain_um_per_K_mm", "p0_mm"}};
  along.simpler_cause =
      place.kind == SubjectKind::input ? "wrong_coefficient" : "missing_temperature";
  along.simpler_subject = temperature;  // without the position
  along.columns = [&material, rise_K = material.values_of(place),
                   position_mm = material.values_of(position)](const Shapes&, std::size_t) {
    return material.stacked([&](const MeasuredRun& run) {
      Panel both(run.rows(), 2);
      both << position_mm(run).cwiseProduct(rise_K(run)), rise_K(run);
      return both;
    });
  };
  return along;
}

/// With every position that the machine went to.
std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input && subject.kind != SubjectKind::other_temperature)
    return {};
  std::vector<Hypothesis> all;
  const auto& signals = material.data().signals;
  for (std::size_t signal = 0; signal < signals.size(); ++signal) {
    const Subject position{SubjectKind::signal, signal};
    if (kind_of(signals[signal]) != QuantityKind::position) continue;
    if (!material.moves_anywhere(material.values_of(position))) continue;
    all.push_back(along(material, subject, position));
  }
  return all;
}

/// p0 = -b / c of c p T + b T; over several outputs weighted by c^2.
Parameter pivot(const FoundGains& found) {
  double above = 0.0;
  double below = 0.0;
  for (const Eigen::VectorXd& gains : found.gains) {
    if (gains.size() == 0) continue;
    above -= gains[0] * gains[1];
    below += gains[0] * gains[0];
  }
  return {"p0_mm", {{"", below > 0 ? above / below : 0.0}}, {}};
}

std::vector<Parameter> gains(const FoundGains& found) {
  return {gain_table(found, 0), pivot(found)};
}

}  // namespace

/// c (p - p0) T: the effect of a temperature grows along an axis.
Cause position_dependence() {
  Cause cause{name, "structure"};
  cause.parameters = {
      {.name = "gain_um_per_K_mm", .unit = "um/(K mm)", .says = "effect along the axis"},
      {.name = "p0_mm", .unit = "mm", .says = "none at"}};
  cause.texts = {"The effect grows along the axis",
                 "the effect of this temperature grows along the axis",
                 "Use the extended model, or give the model a guideway along this axis."};
  cause.experiment = Experiment::along_the_axis;
  cause.term = name;
  cause.hypotheses = of;
  cause.gains = gains;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
