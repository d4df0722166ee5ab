#include "modelling/diagnosis/rank/spread.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double normal_95 = 1.96;
/// What a machine does besides is no noise of this fit: deviations are larger by this factor. Jumps
/// need none.
constexpr double wider_on_machines = 4.5;
constexpr std::size_t fine_points = 33;

Interval hull(const Interval& a, double low, double high) {
  return {std::min(a.low, low), std::max(a.high, high)};
}

bool of_a_jump(const Hypothesis& hypothesis, const std::string& parameter) {
  const CauseParameter* const known = find_parameter(cause_named(hypothesis.cause), parameter);
  return known != nullptr && known->of_a_jump;
}

double wider(const Hypothesis& hypothesis, const std::string& parameter) {
  return of_a_jump(hypothesis, parameter) ? 1.0 : wider_on_machines;
}

/// The grid and three points between any two of it, and many between the neighbours of the value
/// found; ascending.
std::vector<double> values_of(const ShapeParameter& of, double found) {
  std::vector<double> values = {found, of.grid.front()};
  for (std::size_t i = 1; i < of.grid.size(); ++i)
    for (const double share : {0.25, 0.5, 0.75, 1.0})
      values.push_back(of.grid[i - 1] + share * (of.grid[i] - of.grid[i - 1]));
  const auto above = std::upper_bound(of.grid.begin(), of.grid.end(), found);
  const double low = above - of.grid.begin() >= 2 ? *(above - 2) : of.grid.front();
  const double high = of.grid.end() - above >= 2 ? *(above + 1) : of.grid.back();
  const std::vector<double> fine = of.logarithmic && low > 0
                                       ? logarithmic_grid(low, high, fine_points)
                                       : linear_grid(low, high, fine_points);
  values.insert(values.end(), fine.begin(), fine.end());
  std::sort(values.begin(), values.end());
  return values;
}

}  // namespace

void set_spread(const Fits& fits, Finding& finding) {
  Explanation& found = finding.explanation;
  const Hypothesis& hypothesis = *found.hypothesis;
  const Fits::Trial best = fits.trials(hypothesis, {found.shape}).front();
  found.gains = best.gains;
  const auto gains_reach = [&](const Fits::Trial& trial, std::size_t output, Eigen::Index i) {
    const double reach = normal_95 * trial.gain_sd[output][i] *
                         wider(hypothesis, hypothesis.gains[static_cast<std::size_t>(i)]);
    return std::pair(trial.gains[output][i] - reach, trial.gains[output][i] + reach);
  };
  finding.shape_ci.assign(found.shape.size(), {});
  finding.gains_ci.assign(found.gains.size(), {});
  if (!hypothesis.gains.empty())
    for (std::size_t output = 0; output < found.gains.size(); ++output)
      for (Eigen::Index i = 0; i < best.gains[output].size(); ++i) {
        const auto [low, high] = gains_reach(best, output, i);
        finding.gains_ci[output].push_back({low, high});
      }
  for (std::size_t parameter = 0; parameter < found.shape.size(); ++parameter) {
    const ShapeParameter& of = hypothesis.shape[parameter];
    finding.shape_ci[parameter] = {found.shape[parameter], found.shape[parameter]};
    if (of.discrete) continue;
    Shapes shapes;
    const std::vector<double> values = values_of(of, found.shape[parameter]);
    for (const double value : values) {
      shapes.push_back(found.shape);
      shapes.back()[parameter] = value;
    }
    const std::vector<Fits::Trial> trials = fits.trials(hypothesis, shapes);
    const double limit = best.score - 0.5 * std::pow(normal_95 * wider(hypothesis, of.name), 2);
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (trials[i].score < limit) continue;
      // Up to half of the way to the next value, which is out of reach.
      Interval& shape = finding.shape_ci[parameter];
      shape = hull(shape, 0.5 * (values[i] + values[i == 0 ? 0 : i - 1]),
                   0.5 * (values[i] + values[std::min(i + 1, values.size() - 1)]));
      for (std::size_t output = 0; output < finding.gains_ci.size(); ++output)
        for (std::size_t g = 0; g < finding.gains_ci[output].size(); ++g) {
          if (trials[i].gains[output].size() == 0) continue;
          const double gain = trials[i].gains[output][static_cast<Eigen::Index>(g)];
          finding.gains_ci[output][g] = hull(finding.gains_ci[output][g], gain, gain);
        }
    }
  }
}

}  // namespace thermocomp::diagnosis
