#include <algorithm>
#include <cmath>
#include <numbers>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "periodic_disturbance";
constexpr std::size_t periods_max = 400;

/// At least five whole periods in the longest run; fine enough that a neighbour of the true period
/// is at most a fifth of a turn off at the run's end.
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

/// A sine and a cosine for each run, those of one period after those of another.
Panel waves(const Material& material, const Shapes& shapes) {
  const StackedRows& rows = material.rows();
  const Eigen::Index width = 2 * std::ssize(rows.runs);
  Panel all = Panel::Zero(rows.time_s.size(), width * std::ssize(shapes));
  for (std::size_t i = 0; i < shapes.size(); ++i)
    for (std::size_t run = 0; run < rows.runs.size(); ++run) {
      const Block& block = rows.runs[run];
      const Eigen::Index count = block.end - block.begin;
      const Eigen::ArrayXd angle =
          2.0 * std::numbers::pi / shapes[i][0] * rows.time_s.segment(block.begin, count).array();
      const auto first = width * static_cast<Eigen::Index>(i) + 2 * static_cast<Eigen::Index>(run);
      all.col(first).segment(block.begin, count) = angle.sin();
      all.col(first + 1).segment(block.begin, count) = angle.cos();
    }
  return all;
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::output) return {};
  const std::vector<double> periods = periods_of(material);
  if (periods.empty()) return {};
  std::vector<std::string> gains;
  for (std::size_t run = 0; run < material.data().runs.size(); ++run)
    gains.insert(gains.end(), {"sine_um", "cosine_um"});
  Hypothesis period{name,
                    material.name_of(subject),
                    Form::own_gains,
                    {{"period_s", periods, true, false}},
                    gains};
  period.output = subject.index;
  period.columns = [&material](const Shapes& shapes, std::size_t) {
    return waves(material, shapes);
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

}  // namespace

/// A sine unrelated to any input, its phase another one in every run: a cooler's or a room's cycle.
Cause periodic_disturbance() {
  Cause cause{name, "datum"};
  cause.parameters = {{.name = "period_s", .unit = "s", .low = 0.0, .says = "period"},
                      {.name = "amplitude_um", .unit = "um", .low = 0.0, .says = "amplitude"}};
  cause.texts = {"A cycle of its own", "a cycle of its own, which no temperature here explains",
                 "Look for what switches with this period: a cooler, a pump, the room's "
                 "ventilation."};
  cause.hypotheses = of;
  cause.gains = amplitude;
  cause.correction = [](const std::vector<Parameter>& parameters) {
    return Correction{0, 0.0, shared_value(parameters, "period_s"),
                      shared_value(parameters, "amplitude_um")};
  };
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
