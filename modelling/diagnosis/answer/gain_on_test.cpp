#include "modelling/diagnosis/answer/gain_on_test.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr int resamples = 400;
constexpr int test_blocks = 16;
constexpr double turn = 6.283185307179586;

/// The sine of known period and size that fits the residual best beside a level: only its phase is
/// free.
Column sine_in(const Column& time_s, const Column& residual, const Correction& correction) {
  const Eigen::ArrayXd angle = turn / correction.period_s * time_s.array();
  Eigen::MatrixXd waves(time_s.size(), 3);
  waves << angle.sin(), angle.cos(), Eigen::ArrayXd::Ones(time_s.size());
  const Eigen::ArrayXd there = residual.array().isFinite().cast<double>();
  const Column values = residual.array().isFinite().select(residual.array(), 0.0);
  waves.array().colwise() *= there;
  const Eigen::Vector3d of = (waves.transpose() * waves).ldlt().solve(waves.transpose() * values);
  return correction.amplitude_um * (angle + std::atan2(of[1], of[0])).sin();
}

struct BlockSquares {
  double before{0.0};
  double after{0.0};
};

std::vector<BlockSquares> squares_by_block(const Residuals& before, const Residuals& after) {
  std::vector<BlockSquares> blocks;
  Eigen::Index rows = 0;
  for (const Column& run : before.by_run) rows += run.size();
  const Eigen::Index length = std::max<Eigen::Index>(1, rows / test_blocks);
  for (std::size_t i = 0; i < before.by_run.size(); ++i) {
    for (Eigen::Index row = 0; row < before.by_run[i].size(); ++row) {
      if (row % length == 0) blocks.emplace_back();
      const double a = before.by_run[i][row];
      const double b = after.by_run[i][row];
      if (!std::isfinite(a) || !std::isfinite(b)) continue;
      blocks.back().before += a * a;
      blocks.back().after += b * b;
    }
  }
  return blocks;
}

double peak(const Residuals& residuals) {
  double largest = not_a_number;
  for (const Column& run : residuals.by_run)
    for (const double value : run)
      if (std::isfinite(value) && !(std::abs(value) <= largest)) largest = std::abs(value);
  return largest;
}

}  // namespace

std::vector<Residuals> residuals(const MeasuredData& data) {
  std::vector<Residuals> all(data.model.outputs.size());
  for (const MeasuredRun& run : data.runs)
    for (std::size_t output = 0; output < all.size(); ++output)
      all[output].by_run.emplace_back(
          (run.measured_um[output] - run.model_um[output]).tail(run.rows() - run.begin));
  return all;
}

std::vector<Residuals> residuals(const Extended& extended, const MeasuredData& data) {
  std::vector<Residuals> all(data.model.outputs.size());
  for (const MeasuredRun& run : data.runs) {
    std::vector<Column> predictions = model_over(extended.model, run, data);
    for (std::size_t output = 0; output < all.size(); ++output) {
      Column& predicted = predictions[output];
      const Column& measured = run.measured_um[output];
      Eigen::Index start = 0;
      while (start < run.rows() && !std::isfinite(measured[start])) ++start;
      for (const Correction& correction : extended.corrections) {
        if (correction.output != output) continue;
        if (correction.period_s > 0)
          predicted += sine_in(run.time_s, measured - predicted, correction);
        else
          predicted = shifted(run.time_s, predicted, correction.shift_s);
      }
      if (start < run.rows()) predicted.array() -= double(predicted[start]);
      all[output].by_run.emplace_back((measured - predicted).tail(run.rows() - run.begin));
    }
  }
  return all;
}

double root_mean_square(const Residuals& residuals) {
  double sum = 0.0;
  double count = 0.0;
  for (const Column& run : residuals.by_run) {
    for (const double value : run) {
      if (!std::isfinite(value)) continue;
      sum += value * value;
      count += 1.0;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : not_a_number;
}

OutputFigures output_figures(const Residuals& train, const Residuals& test,
                             const Residuals& extended_test, double unexplained_fraction) {
  return {root_mean_square(train),         root_mean_square(test), peak(test),
          root_mean_square(extended_test), peak(extended_test),    unexplained_fraction};
}

TestGain test_gain(const Residuals& before, const Residuals& after) {
  TestGain gain{root_mean_square(before), root_mean_square(after), 0.0, {}};
  gain.reduction = 1.0 - gain.after_um / gain.before_um;
  const std::vector<BlockSquares> blocks = squares_by_block(before, after);
  std::mt19937_64 random(1);  // the same answer for the same data
  std::uniform_int_distribution<std::size_t> draw(0, blocks.size() - 1);
  std::vector<double> reductions;
  for (int i = 0; i < resamples; ++i) {
    BlockSquares sum;
    for (std::size_t j = 0; j < blocks.size(); ++j) {
      const BlockSquares& block = blocks[draw(random)];
      sum.before += block.before;
      sum.after += block.after;
    }
    if (sum.before > 0) reductions.push_back(1.0 - std::sqrt(sum.after / sum.before));
  }
  if (reductions.empty()) return gain;
  std::sort(reductions.begin(), reductions.end());
  const auto at = [&](double share) {
    return reductions[static_cast<std::size_t>(share * static_cast<double>(reductions.size() - 1))];
  };
  gain.ci95 = {at(0.025), at(0.975)};
  return gain;
}

bool fails_on_test_runs(const NamedFinding& finding) {
  return !finding.test.empty() &&
         std::none_of(finding.test.begin(), finding.test.end(),
                      [](const auto& of_output) { return of_output.second.reduction > 0; });
}

}  // namespace thermocomp::diagnosis
