#include "modelling/diagnosis/rank/fits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/QR>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double unknown = std::numeric_limits<double>::infinity();
/// Number of temperatures that predict a reading: those with the largest covariance.
constexpr std::size_t neighbours = 8;
constexpr double neighbour_sd_K = 30.0;  ///< for a column whose largest value is 1
constexpr double reading_noise_K = 1e-3;
/// A model counts as fitted if its residual RMS is at most this multiple of that of a fit.
constexpr double fitted_factor = 1.1;
/// Tolerance of the cosine of two proportional vectors, per element: short vectors are
/// proportional by chance.
constexpr double ridge_angle = 0.0015;
/// Largest penalty of a ridge regression, relative to the inputs' variances: with a larger ratio of
/// products to variances the coefficients are wrong.
constexpr double ridge_penalty_max = 0.1;

Panel offsets_of(const OutputRows& rows) {
  Panel offsets = Panel::Zero(rows.size(), std::ssize(rows.runs()));
  for (std::size_t run = 0; run < rows.runs().size(); ++run) {
    const Block& block = rows.runs()[run];
    offsets.col(static_cast<Eigen::Index>(run))
        .segment(block.begin, block.end - block.begin)
        .setOnes();
  }
  return offsets;
}

Panel joined(const Panel& left, const Panel& right) {
  Panel both(left.rows(), left.cols() + right.cols());
  both << left, right;
  return both;
}

Column left_by(const Column& values, const Panel& columns) {
  if (columns.cols() == 0) return values;
  return values - columns * Eigen::VectorXd(columns.colPivHouseholderQr().solve(values));
}

/// RMS of the residual of a fit of the columns.
double rms_beside(const Column& values, const Panel& columns) {
  return std::sqrt(left_by(values, columns).squaredNorm() / static_cast<double>(values.size()));
}

/// True if the coefficients were fitted to these rows, with or without free offsets of the runs,
/// and so may have absorbed a cause: another fit of the same columns then gains nothing. After a
/// ridge regression on standardised inputs, the product of each input's displacement c with the
/// residual is the penalty times the variance of c.
bool fitted_to(const Column& remainder, const Panel& free, const Panel& coefficients) {
  const Eigen::VectorXd variances =
      (coefficients.rowwise() - coefficients.colwise().mean()).colwise().squaredNorm();
  const auto is_ridge = [&](const Panel& beside) {
    const Eigen::VectorXd products = coefficients.transpose() * left_by(remainder, beside);
    const double along = products.dot(variances);
    return along > (1.0 - ridge_angle * static_cast<double>(variances.size())) * products.norm() *
                       variances.norm() &&
           along < ridge_penalty_max * variances.squaredNorm();
  };
  const auto leaves_nothing = [&](const Panel& beside) {
    return rms_beside(remainder, beside) <
           fitted_factor * rms_beside(remainder, joined(beside, coefficients));
  };
  const Panel nothing(remainder.size(), 0);
  return leaves_nothing(free) || leaves_nothing(nothing) ||
         (variances.size() > 2 && (is_ridge(free) || is_ridge(nothing)));
}

/// Least-squares gains, clamped to the bounds if there is one gain.
Eigen::VectorXd gains_of(const Equations& equations, Eigen::Index shape, Eigen::Index under,
                         const Interval& bounds) {
  Eigen::MatrixXd square = equations.square_of(shape, under);
  square.diagonal().array() += 1e-9 * square.trace() + 1e-300;
  Eigen::VectorXd gains = square.ldlt().solve(equations.right_of(shape, under));
  if (gains.size() == 1) gains[0] = std::clamp(gains[0], bounds.low, bounds.high);
  return gains;
}

double explained_by(const Equations& equations, Eigen::Index shape, Eigen::Index under,
                    const Eigen::VectorXd& gains) {
  return 2.0 * gains.dot(equations.right_of(shape, under)) -
         gains.dot(equations.square_of(shape, under) * gains);
}

/// ln L of one output under each background, the gains given.
Eigen::VectorXd likelihoods(const OutputFit& fit, const Equations& equations, Eigen::Index shape,
                            const Eigen::VectorXd& gains) {
  Eigen::VectorXd all(equations.right.cols());
  const double square = equations.size_of(shape, gains);
  for (Eigen::Index under = 0; under < all.size(); ++under)
    all[under] = fit.log_likelihood(under, explained_by(equations, shape, under, gains), square);
  return all;
}

Interval bounds_of(const Hypothesis& hypothesis, std::size_t output) {
  return hypothesis.bounds ? hypothesis.bounds(output) : Interval{-unknown, unknown};
}

}  // namespace

const OutputFit& Readings::of(std::size_t input) {
  std::unique_ptr<OutputFit>& made = made_[input];
  if (made) return *made;
  OutputRows rows(data_.rows,
                  Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(data_.rows.time_s.size(), true));
  const auto mean = [&](const Column& column) -> Column { return rows.means_of(column); };
  const auto rise_K = [](std::size_t i) {
    return [i](const MeasuredRun& run) -> const Column& { return run.temps_K[i]; };
  };
  const Column own = mean(stacked(data_, rise_K(input)));
  const Column centred_own = centred_in(rows.runs(), own).col(0);
  std::vector<std::pair<double, Panel>> others;  // minus covariance with the reading
  for (std::size_t i = 0; i < data_.temperatures.size(); ++i) {
    if (i == input) continue;
    Panel both(rows.size(), 2);
    both.col(0) = mean(stacked(data_, rise_K(i)));
    both.col(1) = mean(stacked(
        data_, [&](const MeasuredRun& run) { return lagged(run.time_s, run.temps_K[i], 1800.0); }));
    const Column centred = centred_in(rows.runs(), both.col(0)).col(0);
    others.emplace_back(-std::abs(centred_own.dot(centred)) / (centred.norm() + 1e-12), both);
  }
  std::sort(others.begin(), others.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  if (others.size() > neighbours) others.resize(neighbours);
  const Panel offsets = offsets_of(rows);
  Panel common = offsets;
  for (const auto& [closeness, both] : others) common = joined(common, both);
  for (std::size_t i = 0; i < data_.signals.size(); ++i)
    for (const double tau_s : {600.0, 3600.0})
      common = joined(common, mean(stacked(data_, [&](const MeasuredRun& run) {
                        return lagged(run.time_s, run.signals[i], tau_s);
                      })));
  for (Eigen::Index i = offsets.cols(); i < common.cols(); ++i)
    common.col(i) /= common.col(i).cwiseAbs().maxCoeff() + 1e-9;
  Eigen::VectorXd sd = Eigen::VectorXd::Constant(common.cols(), neighbour_sd_K);
  sd.head(offsets.cols()).setConstant(unknown);
  made = std::make_unique<OutputFit>(std::move(rows), own, common, sd, reading_noise_K);
  return *made;
}

Fits::Fits(const MeasuredData& data, Readings& readings, const std::vector<Explanation>& accepted)
    : data_(data), readings_(readings), outputs_(data.model.outputs.size()) {
  for (std::size_t output = 0; output < outputs_.size(); ++output) {
    Column left = stacked(data, [output](const MeasuredRun& run) -> Column {
      return run.measured_um[output] - run.model_um[output];
    });
    const Eigen::Array<bool, Eigen::Dynamic, 1> present = left.array().isFinite();
    if (present.count() < static_cast<Eigen::Index>(values_min)) continue;
    left = present.select(left.array(), 0.0);
    OutputRows of(data.rows, present);
    Panel free = offsets_of(of);
    for (const Explanation& each : accepted) {
      if (each.gains[output].size() == 0) continue;
      const Panel columns = each.hypothesis->columns({each.shape}, output);
      if (each.hypothesis->form == Form::no_gain)
        left -= columns.col(0);
      else
        free = joined(free, of.means_of(columns));
    }
    // Small errors of the coefficients are part of every hypothesis.
    Panel coefficients(of.size(), data.coefficient_sd > 0 ? std::ssize(data.model.inputs) : 0);
    for (Eigen::Index i = 0; i < coefficients.cols(); ++i)
      coefficients.col(i) = of.means_of(stacked(data, [&](const MeasuredRun& run) -> Column {
        const auto input = static_cast<std::size_t>(i);
        return answer_to_errors(data, run, output, input, run.temps_K[input]);
      }));
    const Column means = of.means_of(left);
    const bool fitted = coefficients.cols() > 0 && fitted_to(means, free, coefficients);
    Eigen::VectorXd sd = Eigen::VectorXd::Constant(free.cols() + coefficients.cols(), unknown);
    sd.tail(coefficients.cols()).setConstant(fitted ? 1.0 : data.coefficient_sd);
    const double least = data.least_noise_um.empty() ? 1e-3 : data.least_noise_um[output];
    const std::vector<Block> runs = of.runs();
    // Coefficients of these rows are fitted again without the left-out ones.
    Panel beside = free.rightCols(free.cols() - std::ssize(runs));
    if (fitted) beside = joined(beside, coefficients);
    outputs_[output] = {OutputFit(std::move(of), means, joined(free, coefficients), sd, least),
                        std::move(free), std::move(coefficients),
                        LeftOut(centred_in(runs, means).col(0), centred_in(runs, beside)), fitted};
  }
}

bool Fits::concerns(const Hypothesis& hypothesis, std::size_t output) const {
  return outputs_[output] && (!hypothesis.output || *hypothesis.output == output);
}

void Fits::fit_own_gains(const std::vector<Equations>& equations, Eigen::Index shape,
                         Explanation& trial) const {
  const Hypothesis& hypothesis = *trial.hypothesis;
  const auto measured = std::count_if(outputs_.begin(), outputs_.end(),
                                      [](const auto& each) { return each.has_value(); });
  const bool may_spare = !hypothesis.output && measured > 1;
  double most = -unknown;
  std::size_t most_of = 0;
  std::vector<std::size_t> spared;
  for (std::size_t output = 0; output < outputs_.size(); ++output) {
    if (!concerns(hypothesis, output)) continue;
    const OutputFit& fit = outputs_[output]->fit;
    const Interval bounds = bounds_of(hypothesis, output);
    Eigen::VectorXd of_background(equations[output].right.cols());
    double best = -unknown;
    Eigen::VectorXd best_gains;
    Eigen::Index best_under = 0;
    for (Eigen::Index under = 0; under < of_background.size(); ++under) {
      const Eigen::VectorXd gains = gains_of(equations[output], shape, under, bounds);
      of_background[under] =
          fit.log_likelihood(under, explained_by(equations[output], shape, under, gains),
                             equations[output].size_of(shape, gains));
      if (of_background[under] > best) {
        best = of_background[under];
        best_gains = gains;
        best_under = under;
      }
    }
    const double none = fit.log_likelihood_of_none();
    const double with = log_mean_exp(of_background) - none -
                        0.5 * static_cast<double>(hypothesis.gains.size()) *
                            std::log(static_cast<double>(fit.rows().size()));
    // Prior: acting and not acting on an output are equally likely.
    trial.score += may_spare ? log_mean_exp(Eigen::Vector2d(with, 0.0)) : with;
    const double variance =
        fit.variance(best_under, explained_by(equations[output], shape, best_under, best_gains));
    trial.gains[output] = best_gains;
    trial.gain_sd[output] = (variance * equations[output]
                                            .square_of(shape, best_under)
                                            .completeOrthogonalDecomposition()
                                            .pseudoInverse()
                                            .diagonal()
                                            .array()
                                            .max(0.0))
                                .sqrt();
    if (may_spare && !(with > 0.0)) spared.push_back(output);
    if (with <= most) continue;
    most = with;
    most_of = output;
  }
  for (const std::size_t output : spared) {
    if (output == most_of) continue;  // it must act on one output
    trial.gains[output].resize(0);
    trial.gain_sd[output].resize(0);
  }
}

void Fits::fit_shared_gain(const std::vector<Equations>& equations, const Equations* of_reading,
                           double shrunk_rows, Eigen::Index shape, Explanation& trial) const {
  const Hypothesis& hypothesis = *trial.hypothesis;
  struct Part {
    const OutputFit* fit;
    const Equations* equations;
    Eigen::Index under;
  };
  std::vector<Part> parts;
  double rows = 0.0;
  const Eigen::VectorXd nothing = Eigen::VectorXd::Zero(1);
  const auto add = [&](const OutputFit& fit, const Equations& of) {
    Part part{&fit, &of, 0};
    likelihoods(fit, of, shape, nothing).maxCoeff(&part.under);
    parts.push_back(part);
    rows += static_cast<double>(fit.rows().size());
  };
  for (std::size_t output = 0; output < outputs_.size(); ++output)
    if (concerns(hypothesis, output)) add(outputs_[output]->fit, equations[output]);
  if (of_reading != nullptr) add(readings_.of(*hypothesis.sensor), *of_reading);
  const Interval bounds = bounds_of(hypothesis, 0);
  Eigen::VectorXd gain = Eigen::VectorXd::Ones(1);
  Eigen::VectorXd gain_sd = Eigen::VectorXd::Zero(1);
  for (int again = 0; again < 3 && hypothesis.form == Form::shared_gain; ++again) {
    double right = 0.0;
    double square = 1e-300;
    for (Part& part : parts) {
      if (again > 0) likelihoods(*part.fit, *part.equations, shape, gain).maxCoeff(&part.under);
      const double variance = part.fit->variance(
          part.under, again > 0 ? explained_by(*part.equations, shape, part.under, gain) : 0.0);
      right += part.equations->right_of(shape, part.under)[0] / variance;
      square += part.equations->square_of(shape, part.under)(0, 0) / variance;
    }
    gain[0] = std::clamp(right / square, bounds.low, bounds.high);
    gain_sd[0] = 1.0 / std::sqrt(square);
  }
  for (std::size_t output = 0; output < outputs_.size(); ++output)
    if (concerns(hypothesis, output)) {
      trial.gains[output] = gain;
      trial.gain_sd[output] = gain_sd;
    }
  for (const Part& part : parts) {
    const double gained = log_mean_exp(likelihoods(*part.fit, *part.equations, shape, gain)) -
                          part.fit->log_likelihood_of_none();
    trial.score += gained;
    if (part.equations == of_reading) trial.witness = gained;
  }
  // Jacobian of the scaling of a loose sensor's motion.
  if (of_reading != nullptr && shrunk_rows > 0) {
    const double grown = shrunk_rows * std::log1p(gain[0]);
    trial.score += grown;
    trial.witness += grown;
  }
  if (hypothesis.form == Form::shared_gain) trial.score -= 0.5 * std::log(std::max(2.0, rows));
}

std::vector<Explanation> Fits::trials(const Hypothesis& hypothesis, const Shapes& shapes) const {
  std::vector<Equations> equations(outputs_.size());
  std::vector<Panel> columns(outputs_.size());
  for (std::size_t output = 0; output < outputs_.size(); ++output)
    if (concerns(hypothesis, output)) {
      const OutputFit& fit = outputs_[output]->fit;
      columns[output] = fit.rows().means_of(hypothesis.columns(shapes, output));
      equations[output] = fit.equations(columns[output], hypothesis.width());
    }
  std::optional<Equations> of_reading;
  Eigen::VectorXd shrunk = Eigen::VectorXd::Zero(std::ssize(shapes));
  if (hypothesis.sensor) {
    const OutputFit& reading = readings_.of(*hypothesis.sensor);
    const Panel errors_K = reading.rows().means_of(stacked(
        data_, [&](const MeasuredRun& run) { return hypothesis.errors_K(run, shapes); },
        hypothesis.run));
    of_reading = reading.equations(errors_K, 1);
    if (hypothesis.shrinks_reading)
      shrunk = (errors_K.array() != 0.0).cast<double>().colwise().sum().transpose();
  }
  std::vector<Explanation> all;
  for (Eigen::Index shape = 0; shape < std::ssize(shapes); ++shape) {
    all.push_back({&hypothesis, shapes[static_cast<std::size_t>(shape)]});
    Explanation& trial = all.back();
    trial.gains.resize(outputs_.size());
    trial.gain_sd.resize(outputs_.size());
    if (hypothesis.form == Form::own_gains)
      fit_own_gains(equations, shape, trial);
    else
      fit_shared_gain(equations, of_reading ? &*of_reading : nullptr, shrunk[shape], shape, trial);
  }
  for (std::size_t output = 0; output < outputs_.size(); ++output)
    if (concerns(hypothesis, output)) judge_left_out(hypothesis, output, columns[output], all);
  return all;
}

void Fits::judge_left_out(const Hypothesis& hypothesis, std::size_t output, const Panel& columns,
                          std::vector<Explanation>& trials) const {
  const LeftOut& left_out = outputs_[output]->left_out;
  const std::vector<Block>& runs = outputs_[output]->fit.rows().runs();
  const Panel centred = centred_in(runs, columns);
  const Eigen::Index width = hypothesis.width();
  const Column before = left_out.beside_accepted(left_out.values());
  const Panel own = left_out.beside_accepted(centred);
  // Hypotheses without own gains, or of one run, have few parameters: no rows are left out.
  // Otherwise the smaller residual counts, of gains fitted to the other rows and of those under the
  // likeliest background, which slow disturbances do not bias.
  const bool as_fitted = hypothesis.run || hypothesis.form != Form::own_gains;
  const Block rows = hypothesis.run ? runs[*hypothesis.run] : Block{0, before.size()};
  std::vector<double> left;
  if (!as_fitted) left = left_out.after(centred, width, bounds_of(hypothesis, output));
  for (std::size_t i = 0; i < trials.size(); ++i) {
    Explanation& trial = trials[i];
    if (trial.gains[output].size() == 0) continue;
    const Column after =
        before - own.middleCols(width * static_cast<Eigen::Index>(i), width) * trial.gains[output];
    double was = before.segment(rows.begin, rows.end - rows.begin).squaredNorm();
    double is = after.segment(rows.begin, rows.end - rows.begin).squaredNorm();
    if (!as_fitted) {
      was = left_out.before();
      is = std::min(is, left[i]);
    }
    const double gained = 0.5 * std::log(std::max(was, 1e-12) / std::max(is, 1e-12));
    trial.left_out += gained;
    trial.left_out_of_best = std::max(trial.left_out_of_best, gained);
  }
}

Eigen::VectorXd Fits::coefficient_errors(std::size_t output) const {
  const auto inputs = std::ssize(data_.model.inputs);
  const bool plain = data_.model.terms.empty() && data_.model.guideways.empty();
  if (!outputs_[output] || !(data_.coefficient_sd > 0) || !plain)
    return Eigen::VectorXd::Zero(inputs);
  return outputs_[output]->fit.common_factors().tail(inputs);
}

Column Fits::effect_of(const Explanation& explanation, std::size_t output) const {
  const OutputRows& rows = outputs_[output]->fit.rows();
  const Panel columns = explanation.hypothesis->columns({explanation.shape}, output);
  return centred_in(rows.runs(), rows.means_of(columns) * explanation.gains[output]).col(0);
}

double Fits::rms_left(std::size_t output, bool corrected) const {
  const Output& of = *outputs_[output];
  Column left = of.fit.remainder();
  if (corrected && of.coefficients.cols() > 0) left -= of.coefficients * coefficient_errors(output);
  return rms_beside(left, of.free);
}

namespace {

constexpr double normal_95 = 1.96;
/// The form of a column is approximate, so the error of a shape parameter is this multiple of its
/// standard deviation. Jumps need no factor.
constexpr double wider_on_machines = 4.5;
/// For the same reason the error of a gain is a multiple of its standard deviation plus a share of
/// the gain, set for a coverage of 93 % of 112 planted gains (seeds of research/README.md).
constexpr double gain_wider = 2.0;
constexpr double gain_share = 0.2;
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

/// Standard deviation of a gain with model discrepancy.
double gain_deviation(const Hypothesis& hypothesis, std::size_t number, double gain, double sd) {
  return of_a_jump(hypothesis, hypothesis.gains[number])
             ? sd
             : std::hypot(gain_wider * sd, gain_share * gain);
}

/// The grid, three points in each of its intervals, and many points near the estimate; ascending.
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

bool set_spread(const Fits& fits, Finding& finding) {
  Explanation& found = finding.explanation;
  const Hypothesis& hypothesis = *found.hypothesis;
  const Explanation best = fits.trials(hypothesis, {found.shape}).front();
  found.gains = best.gains;
  const auto gains_reach = [&](const Explanation& trial, std::size_t output, Eigen::Index i) {
    const double gain = trial.gains[output][i];
    const double reach = normal_95 * gain_deviation(hypothesis, static_cast<std::size_t>(i), gain,
                                                    trial.gain_sd[output][i]);
    return std::pair(gain - reach, gain + reach);
  };
  finding.shape_ci.assign(found.shape.size(), {});
  finding.gains_ci.assign(found.gains.size(), {});
  bool is_known = hypothesis.gains.empty();
  if (!hypothesis.gains.empty())
    for (std::size_t output = 0; output < found.gains.size(); ++output)
      for (Eigen::Index i = 0; i < best.gains[output].size(); ++i) {
        const auto [low, high] = gains_reach(best, output, i);
        finding.gains_ci[output].push_back({low, high});
        is_known = is_known || low > 0.0 || high < 0.0;
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
    const std::vector<Explanation> trials = fits.trials(hypothesis, shapes);
    const double limit = best.score - 0.5 * std::pow(normal_95 * wider(hypothesis, of.name), 2);
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (trials[i].score < limit) continue;
      // Up to half the distance to the next value, which may be outside.
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
  return is_known;
}

}  // namespace thermocomp::diagnosis
