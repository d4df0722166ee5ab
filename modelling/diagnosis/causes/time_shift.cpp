#include <algorithm>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "time_shift";
constexpr CauseParameter shift{"shift_s", "s", -3600.0, 3600.0, "shifted by"};

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::output) return {};
  const ColumnOf model_um = [output = subject.index](const MeasuredRun& run) -> const Column& {
    return run.model_um[output];
  };
  if (!(material.range(model_um) > 0)) return {};
  std::vector<double> shifts =
      logarithmic_grid(std::max(5.0, 0.2 * material.step_s()), shift.high, 14);
  for (std::size_t i = 0, count = shifts.size(); i < count; ++i)
    shifts.insert(shifts.begin(), -shifts[2 * i]);
  Hypothesis late{
      name, material.name_of(subject), Form::no_gain, {{std::string(shift.name), shifts}}};
  late.output = subject.index;
  late.columns = [&material, model_um](const Shapes& shapes, std::size_t) {
    return material.stacked([&](const MeasuredRun& run) {
      // Interpolation averages two rows; both sides are smoothed, so that less noise is no gain.
      const Column smooth_um = smoothed(run.time_s, model_um(run), 2.0 * material.step_s());
      Panel all(run.rows(), std::ssize(shapes));
      for (std::size_t i = 0; i < shapes.size(); ++i)
        all.col(static_cast<Eigen::Index>(i)) =
            shifted(run.time_s, smooth_um, shapes[i][0]) - smooth_um;
      return all;
    });
  };
  return {std::move(late)};
}

}  // namespace

/// The displacement is logged late (shift > 0) or early.
Cause time_shift() {
  Cause cause{name, "datum"};
  cause.parameters = {shift};
  cause.texts = {
      "The recorders' clocks differ",
      "the displacement is logged at other times than the temperatures",
      "Set the clocks of both recorders, or correct the time column before anything is fitted."};
  cause.experiment = Experiment::up_and_down;
  cause.hypotheses = of;
  cause.correction = [](const std::vector<Parameter>& parameters) {
    return Correction{0, shared_value(parameters, "shift_s"), 0.0, 0.0};
  };
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
