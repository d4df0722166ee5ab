// How far the parameters of findings are known.
#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "modelling/diagnosis/evidence/left_out.hpp"
#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Student's t of seven degrees of freedom over the normal distribution at 97.5 %: what eight
/// blocks tell is itself uncertain.
constexpr double few_blocks = 1.2;
/// Chi squared of one degree of freedom at 95 %: by so much 2 ln L may be behind.
constexpr double as_likely = 3.84;
/// A point of the grid beside a peak has at least this share of its gain: of a period's grid, a
/// fifth of a turn off, 2 of ln(amplitude^2 / noise^2).
constexpr double near_peak = 0.2;

}  // namespace

/// From the curvature of 2 ln L at its peak: it falls by 1 a standard deviation away. Where a side
/// of the peak is physically impossible, the other one tells.
double Search::shape_sd(const Explanation& explanation, std::size_t parameter) const {
  const ShapeParameter& of = explanation.hypothesis->shape[parameter];
  if (of.discrete || !(explanation.score > 0)) return 0.0;
  const double value = explanation.shape[parameter];
  if (of.logarithmic && !(value > 0)) return 0.0;
  const double range = of.logarithmic ? 1.0 : of.grid.back() - of.grid.front();
  const auto at = [&](double move) -> std::optional<double> {
    Explanation moved = explanation;
    moved.shape[parameter] = of.logarithmic ? value * std::exp(move) : value + move;
    Trial trial = weigh(*moved.hypothesis, moved.shape, moved.settings);
    moved.gains = std::move(trial.gains);
    return acts(moved) ? std::optional<double>(trial.score) : std::nullopt;
  };
  const std::optional<double> peak = at(0.0);
  if (!peak) return range;
  // The curvature is taken where it can be seen above rounding: a fall of a few units.
  for (double step = 1e-3 * range; step < range; step *= 2.0) {
    const std::optional<double> above = at(step);
    const std::optional<double> below = at(-step);
    if (!above && !below) return range;
    const double fall =
        *peak - 0.5 * (above.value_or(below.value_or(0.0)) + below.value_or(above.value_or(0.0)));
    if (fall > 4.0) return step / std::sqrt(fall);
  }
  return range;
}

/// A sine that is probed rarely is one of other periods as well.
/// @param wider  intervals than if whitened rows were independent
Interval Search::rivals(const Explanation& explanation, std::size_t parameter, double wider) const {
  const Hypothesis& hypothesis = *explanation.hypothesis;
  const ShapeParameter& of = hypothesis.shape[parameter];
  Interval outermost{explanation.shape[parameter], explanation.shape[parameter]};
  // Of a catalogue whose columns depend on what is accepted each is a simulation, with one peak.
  if (of.discrete || hypothesis.run || accepted_) return outermost;
  Shapes shapes(of.grid.size(), explanation.shape);
  for (std::size_t i = 0; i < of.grid.size(); ++i) shapes[i][parameter] = of.grid[i];
  const std::vector<Trial> trials = weigh_all(hypothesis, shapes, explanation.settings);
  const double peak = weigh(hypothesis, explanation.shape, explanation.settings).score;
  const auto score = [&](std::size_t i) { return i < trials.size() ? trials[i].score : 0.0; };
  for (std::size_t i = 0; i < trials.size(); ++i) {
    if (score(i) < near_peak * peak || score(i) < score(i + 1) || score(i) < score(i - 1)) continue;
    Explanation rival = explanation;
    rival.shape[parameter] = of.grid[i];
    if (!(refine(rival).score > peak - as_likely * wider * wider)) continue;
    outermost.low = std::min(outermost.low, rival.shape[parameter]);
    outermost.high = std::max(outermost.high, rival.shape[parameter]);
  }
  return outermost;
}

/// How many times wider intervals are than if whitened rows were independent, since no noise of
/// this search is quite that of a machine: scores summed over each of the blocks that can be left
/// out tell, the blocks being far longer than what correlates neighbours.
///
///   factor^2 = B / (B - 1) sum_b (sum_(i in b) x_i w_i)^2 / (sigma^2 sum_i x_i^2)
///
/// with x the whitened column beside the common ones and w what the fit leaves of the residual.
/// Source: the cluster-robust covariance of Liang and Zeger (1986), for one column.
double Search::widening(const Setting& setting, const Panel& columns,
                        const Eigen::VectorXd& gains) const {
  const double count = static_cast<double>(rows_.blocks.size());
  if (count < 2) return 1.0;
  const Panel acting = columns * gains;
  const Eigen::MatrixXd white = setting.whitener().apply(acting);
  const Eigen::MatrixXd common = setting.against().rightCols(setting.precision().size());
  Eigen::MatrixXd square = common.transpose() * common;
  square.diagonal() += setting.precision();
  const Eigen::LLT<Eigen::MatrixXd> factor(square);
  const auto beside = [&](const Eigen::VectorXd& of) -> Eigen::VectorXd {
    return of - common * factor.solve(common.transpose() * of);
  };
  const Eigen::VectorXd x = beside(white.col(0));
  const Eigen::VectorXd residual = beside(setting.against().col(0));
  const double squares = x.squaredNorm();
  if (!(squares > 0)) return 1.0;
  const Eigen::VectorXd left = residual - x * (x.dot(residual) / squares);
  double scores = 0.0;
  for (const Block& block : rows_.blocks) {
    const Eigen::Index rows = block.end - block.begin;
    scores += std::pow(x.segment(block.begin, rows).dot(left.segment(block.begin, rows)), 2);
  }
  const double variance = left.squaredNorm() / setting.present_rows();
  const double wider = count / (count - 1.0) * scores / std::max(1e-300, variance * squares);
  return few_blocks * std::sqrt(std::max(1.0, wider));
}

/// Mean time between values of the run in which the explanation acts, in the output that has most
/// [s].
double Search::step_of_values_s(const Explanation& explanation) const {
  const Block& run = rows_.runs[*explanation.hypothesis->run];
  const double length_s = rows_.time_s[run.end - 1] - rows_.time_s[run.begin];
  Eigen::Index most = 2;
  for (const std::size_t output : measured_)
    if (explanation.gains[output].size() > 0)
      most = std::max<Eigen::Index>(
          most, outputs_[output].present().segment(run.begin, run.end - run.begin).count());
  return length_s / static_cast<double>(most - 1);
}

/// White noise instead of the likeliest, where rows left out are predicted better by it.
void Search::settle_for_left_out_rows(Explanation& explanation) const {
  if (explanation.hypothesis->run) return;  // nothing of it stays in other rows
  Explanation plain = in_white_noise(explanation);
  if (plain.settings == explanation.settings) return;
  refine(plain);
  if (!acts(plain)) return;
  LeftOut left_out(rows_, outputs_);
  if (left_out.gain_on_left_out_blocks(plain).log_left <
      left_out.gain_on_left_out_blocks(explanation).log_left)
    explanation = std::move(plain);
}

void Search::measure_spread(std::vector<Finding>& findings) {
  for (std::size_t i = 0; i < findings.size(); ++i) {
    accept(findings, i);
    Finding& finding = findings[i];
    Explanation& each = finding.explanation;
    settle_anew(each);
    if (!acts(each)) {
      findings.erase(findings.begin() + static_cast<std::ptrdiff_t>(i--));
      continue;
    }
    settle_for_left_out_rows(each);
    finding.shape_sd.clear();
    for (std::size_t k = 0; k < each.shape.size(); ++k)
      finding.shape_sd.push_back(shape_sd(each, k));
    finding.gain_sd.assign(outputs_.size(), Eigen::VectorXd());
    double wider = 1.0;
    for (const std::size_t output : measured_) {
      if (each.gains[output].size() == 0) continue;
      const Setting& setting = *each.settings[output];
      const Panel columns = columns_of(*each.hypothesis, Shapes{each.shape}, outputs_[output]);
      const EquationsTable of =
          Setting::equations_of_groups({&setting}, columns, columns.cols()).front();
      const double squares = setting.squares() - of.taken(0, each.gains[output]);
      const double variance = std::max(0.0, squares) / setting.present_rows();
      const bool no_gain = each.hypothesis->form == Form::no_gain;
      const double times = widening(setting, columns,
                                    no_gain ? Eigen::VectorXd(Eigen::VectorXd::Ones(columns.cols()))
                                            : Eigen::VectorXd(each.gains[output]));
      wider = std::max(wider, times);
      finding.gain_sd[output] =
          times * (variance * Eigen::MatrixXd(of.square(0)).inverse().diagonal()).array().sqrt();
    }
    finding.rivals.clear();
    for (std::size_t k = 0; k < finding.shape_sd.size(); ++k) {
      finding.rivals.push_back(rivals(each, k, wider));
      finding.shape_sd[k] *= wider;
      // An onset is anywhere between two values.
      if (each.hypothesis->run && !each.hypothesis->shape[k].logarithmic)
        finding.shape_sd[k] =
            std::hypot(finding.shape_sd[k], step_of_values_s(each) / std::sqrt(3.0));
    }
  }
}

}  // namespace thermocomp::diagnosis
