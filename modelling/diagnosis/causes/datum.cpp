/// Faults of the measured displacement, and disturbances from outside.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr CauseParameter shift{"shift_s", "s", -3600.0, 3600.0, "shifted by"};

std::vector<Hypothesis> time_shift_hypotheses(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::output) return {};
  const double range_um =
      material.range([output = subject.index](const MeasuredRun& run) -> const Column& {
        return run.model_um[output];
      });
  if (!(range_um > 0)) return {};
  std::vector<double> shifts =
      logarithmic_grid(std::max(5.0, 0.2 * material.step_s()), shift.high, 14);
  for (std::size_t i = 0, count = shifts.size(); i < count; ++i)
    shifts.insert(shifts.begin(), -shifts[2 * i]);
  Hypothesis late{material.name_of(subject), Form::no_gain, {{std::string(shift.name), shifts}}};
  late.output = subject.index;
  late.effect = [&material](const MeasuredRun& run, const Shapes& shapes, std::size_t output) {
    // Interpolation averages two rows and so reduces noise; both sides are smoothed alike.
    const Column smooth_um = smoothed(run.time_s, run.model_um[output], 2.0 * material.step_s());
    Panel all(run.rows(), std::ssize(shapes));
    for (std::size_t i = 0; i < shapes.size(); ++i)
      all.col(static_cast<Eigen::Index>(i)) =
          shifted(run.time_s, smooth_um, shapes[i][0]) - smooth_um;
    return all;
  };
  return {std::move(late)};
}

/// The displacement is logged late (shift > 0) or early.
Cause time_shift() {
  Cause cause{"time_shift", "datum"};
  cause.parameters = {shift};
  cause.texts = {
      "The recorders' clocks differ",
      "the displacement is logged at other times than the temperatures",
      "Set the clocks of both recorders, or correct the time column before anything is fitted."};
  cause.experiment = Experiment::up_and_down;
  cause.hypotheses = time_shift_hypotheses;
  cause.correction = [](const std::vector<Parameter>& parameters, const std::string&) {
    return Correction{.prediction = [shift_s = shared_value(parameters, "shift_s")](
                                        const MeasuredRun& run, std::size_t, Column& predicted_um) {
      predicted_um = shifted(run.time_s, predicted_um, shift_s);
    }};
  };
  return cause;
}

constexpr std::size_t periods_max = 400;

/// Least measured values, mean of the runs: one of many periods fits fewer by chance.
constexpr Eigen::Index wave_values_min = 24;

bool has_values_for_a_wave(const MeasuredData& data, std::size_t output) {
  Eigen::Index values = 0;
  for (const MeasuredRun& run : data.runs)
    values += run.measured_um[output].array().isFinite().count();
  return values >= wave_values_min * std::ssize(data.runs);
}

/// Periods of which the longest run contains at least five, so close that a neighbour of the true
/// period is at most a fifth of a turn off at the run's end.
std::vector<double> periods_of(const Material& material) {
  const double length_s = material.length_s();
  const double longest_s = length_s / 5.0;
  const double shortest_s = 5.0 * material.step_s();
  std::vector<double> periods;
  if (!(longest_s > 2.0 * shortest_s)) return periods;
  for (double frequency = 1.0 / longest_s;
       frequency <= 1.0 / shortest_s && periods.size() < periods_max;
       frequency += std::max(0.4 / length_s, 0.004 * frequency))
    periods.push_back(1.0 / frequency);
  std::reverse(periods.begin(), periods.end());
  return periods;
}

/// A sine and a cosine per run, the columns of one period after those of another.
Panel waves(const MeasuredRun& run, std::size_t runs, const Shapes& shapes) {
  Panel all = Panel::Zero(run.rows(), std::ssize(shapes) * 2 * static_cast<Eigen::Index>(runs));
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const Eigen::ArrayXd angle = 2.0 * std::numbers::pi / shapes[i][0] * run.time_s.array();
    const auto first = static_cast<Eigen::Index>(2 * (runs * i + run.number));
    all.col(first) = angle.sin();
    all.col(first + 1) = angle.cos();
  }
  return all;
}

std::vector<Hypothesis> periodic_disturbance_hypotheses(const Material& material,
                                                        const Subject& subject) {
  if (subject.kind != SubjectKind::output) return {};
  if (!has_values_for_a_wave(material.data(), subject.index)) return {};
  const std::vector<double> periods = periods_of(material);
  if (periods.empty()) return {};
  const std::size_t runs = material.data().runs.size();
  std::vector<std::string> gains;
  for (std::size_t run = 0; run < runs; ++run) gains.insert(gains.end(), {"sine_um", "cosine_um"});
  Hypothesis period{
      material.name_of(subject), Form::own_gains, {{"period_s", periods, true, false}}, gains};
  period.output = subject.index;
  period.effect = [runs](const MeasuredRun& run, const Shapes& shapes, std::size_t) {
    return waves(run, runs, shapes);
  };
  return {std::move(period)};
}

/// Mean over the runs.
std::vector<Parameter> amplitude(const FoundGains& found) {
  const Eigen::VectorXd& waves = found.gains[first_output(found)];
  double sum = 0.0;
  for (Eigen::Index i = 0; i + 1 < waves.size(); i += 2) sum += std::hypot(waves[i], waves[i + 1]);
  return {{"amplitude_um", {{"", 2.0 * sum / static_cast<double>(waves.size())}}, {}}};
}

/// Sine of known period and amplitude, fitted to the residual: only phase and level are free.
Column sine_in(const Column& time_s, const Column& residual,
               const std::vector<Parameter>& parameters) {
  const Eigen::ArrayXd angle =
      2.0 * std::numbers::pi / shared_value(parameters, "period_s") * time_s.array();
  Eigen::MatrixXd waves(time_s.size(), 3);
  waves << angle.sin(), angle.cos(), Eigen::ArrayXd::Ones(time_s.size());
  const Eigen::ArrayXd there = residual.array().isFinite().cast<double>();
  const Column values = residual.array().isFinite().select(residual.array(), 0.0);
  waves.array().colwise() *= there;
  const Eigen::Vector3d of = (waves.transpose() * waves).ldlt().solve(waves.transpose() * values);
  return shared_value(parameters, "amplitude_um") * (angle + std::atan2(of[1], of[0])).sin();
}

/// Sine unrelated to any input, with another phase in every run: cycle of a cooler or a room.
Cause periodic_disturbance() {
  Cause cause{"periodic_disturbance", "datum"};
  cause.parameters = {
      {.name = "period_s", .unit = "s", .low = 0.0, .description = "period"},
      {.name = "amplitude_um", .unit = "um", .low = 0.0, .description = "amplitude"}};
  cause.texts = {"A cycle of its own", "a cycle of its own, which no temperature here explains",
                 "Look for what switches with this period: a cooler, a pump, the room's "
                 "ventilation."};
  cause.hypotheses = periodic_disturbance_hypotheses;
  cause.gains = amplitude;
  cause.correction = [](const std::vector<Parameter>& parameters, const std::string&) {
    return Correction{.prediction = [parameters](const MeasuredRun& run, std::size_t output,
                                                 Column& predicted_um) {
      predicted_um += sine_in(run.time_s, run.measured_um[output] - predicted_um, parameters);
    }};
  };
  return cause;
}

std::vector<Hypothesis> displacement_step_hypotheses(const Material& material,
                                                     const Subject& subject) {
  if (subject.kind != SubjectKind::output_in_run) return {};
  const std::size_t run = subject.run;
  Hypothesis step{
      material.name_of(subject),
      Form::own_gains,
      {{"at_s", material.onsets_s(run, 0.02, 0.98, 52,
                                  material.data().runs[run].measured_um[subject.index])}},
      {"step_um"},
      subject.index,
      run};
  step.effect = [](const MeasuredRun& of, const Shapes& shapes, std::size_t) {
    return since(of.time_s, firsts_of(shapes));
  };
  return {std::move(step)};
}

/// The datum jumps once in a run.
Cause displacement_step() {
  Cause cause{"displacement_step", "datum"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .description = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "step_um", .unit = "um", .description = "jump", .of_a_jump = true}};
  cause.texts = {
      "The datum jumped", "the datum of the displacement jumped once",
      "Do not fit to this run across the jump; look whether the probe was touched or set again."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = displacement_step_hypotheses;
  return cause;
}

std::vector<Hypothesis> displacement_drift_hypotheses(const Material& material,
                                                      const Subject& subject) {
  if (subject.kind != SubjectKind::output_in_run) return {};
  Hypothesis drift{material.name_of(subject), Form::own_gains, {},
                   {"rate_um_per_h"},         subject.index,   subject.run};
  drift.effect = [](const MeasuredRun& run, const Shapes&, std::size_t) -> Column {
    return (run.time_s.array() - run.time_s[run.begin]) / 3600.0;
  };
  return {std::move(drift)};
}

/// The datum creeps through a whole run.
Cause displacement_drift() {
  Cause cause{"displacement_drift", "datum"};
  cause.parameters = {{.name = "rate_um_per_h", .unit = "um/h", .description = "creep"}};
  cause.texts = {"The datum creeps", "the datum of the displacement creeps through the whole run",
                 "Do not fit to this run; look at the probe, its holder and its amplifier's "
                 "warm-up."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = displacement_drift_hypotheses;
  return cause;
}

}  // namespace

std::vector<Cause> of_datum() {
  return {time_shift(), periodic_disturbance(), displacement_step(), displacement_drift()};
}

}  // namespace thermocomp::diagnosis::causes
