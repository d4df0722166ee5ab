#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "displacement_step";

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::output_in_run) return {};
  const std::size_t run = subject.run;
  Hypothesis step{
      name,
      material.name_of(subject),
      Form::own_gains,
      {{"at_s", material.onsets_s(run, 0.02, 0.98, 52,
                                  material.data().runs[run].measured_um[subject.index])}},
      {"step_um"},
      subject.index,
      run};
  step.columns = [&material, run](const Shapes& shapes, std::size_t) {
    return material.in_run(run, since(material.data().runs[run].time_s, firsts_of(shapes)));
  };
  return {std::move(step)};
}

}  // namespace

/// The datum jumps once in a run.
Cause displacement_step() {
  Cause cause{name, "datum"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .says = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "step_um", .unit = "um", .says = "jump", .of_a_jump = true}};
  cause.texts = {
      "The datum jumped", "the datum of the displacement jumped once",
      "Do not fit to this run across the jump; look whether the probe was touched or set again."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = of;
  cause.gains = single_gain;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
