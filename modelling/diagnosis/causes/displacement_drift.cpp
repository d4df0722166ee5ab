#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "displacement_drift";

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::output_in_run) return {};
  Hypothesis drift{name,       material.name_of(subject), Form::own_gains,
                   {},         {"rate_um_per_h"},         subject.index,
                   subject.run};
  drift.columns = [&material, run = subject.run](const Shapes&, std::size_t) {
    const MeasuredRun& of = material.data().runs[run];
    return material.in_run(run, (of.time_s.array() - of.time_s[of.begin]) / 3600.0);
  };
  return {std::move(drift)};
}

}  // namespace

/// The datum creeps through a whole run.
Cause displacement_drift() {
  Cause cause{name, "datum"};
  cause.parameters = {{.name = "rate_um_per_h", .unit = "um/h", .says = "creep"}};
  cause.texts = {"The datum creeps", "the datum of the displacement creeps through the whole run",
                 "Do not fit to this run; look at the probe, its holder and its amplifier's "
                 "warm-up."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = of;
  cause.gains = single_gain;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
