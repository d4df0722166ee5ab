#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "hysteresis";

std::vector<Hypothesis> of_input(const Material& material, const Subject& subject) {
  const double range_K =
      material.range([input = subject.index](const MeasuredRun& run) -> const Column& {
        return run.inputs_K[input];
      });
  Hypothesis play{name,
                  material.name_of(subject),
                  Form::no_gain,
                  {{"width_K", linear_grid(0.04 * range_K, 0.8 * range_K, 16)}}};
  play.columns = [&material, input = subject.index](const Shapes& shapes, std::size_t output) {
    return material.stacked([&](const MeasuredRun& run) {
      return answer_to_errors(material.data(), run, output, input,
                              played_less_values(run.calm_inputs_K[input], firsts_of(shapes)));
    });
  };
  return {std::move(play)};
}

std::vector<Hypothesis> of_output(const Material& material, const Subject& subject) {
  const ColumnOf model_um = [output = subject.index](const MeasuredRun& run) -> const Column& {
    return run.model_um[output];
  };
  const double range_um = material.range(model_um);
  if (!(range_um > 0)) return {};
  Hypothesis play{name,
                  material.name_of(subject),
                  Form::no_gain,
                  {{"width_um", linear_grid(0.03 * range_um, 0.7 * range_um, 20)}}};
  play.output = subject.index;
  play.columns = [&material, model_um](const Shapes& shapes, std::size_t) {
    return material.stacked([&](const MeasuredRun& run) {
      return played_less_values(calm(run.time_s, model_um(run)), firsts_of(shapes));
    });
  };
  return {std::move(play)};
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind == SubjectKind::input) return of_input(material, subject);
  if (subject.kind == SubjectKind::output) return of_output(material, subject);
  return {};
}

}  // namespace

/// Play of a joint, of one temperature's effect or of the whole output: a loop that does not depend
/// on speed.
Cause hysteresis() {
  Cause cause{name, "structure"};
  cause.parameters = {{.name = "width_K", .unit = "K", .low = 0.0, .says = "dead band"},
                      {.name = "width_um", .unit = "um", .low = 0.0, .says = "dead band"}};
  cause.texts = {
      "Something sticks before it follows",
      "what moves sticks before it follows: a loop that does not depend on speed",
      "Look for a joint or a clamp that slips; the extended model carries it until then."};
  cause.experiment = Experiment::twice_as_slow;
  cause.term = name;
  cause.hypotheses = of;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
