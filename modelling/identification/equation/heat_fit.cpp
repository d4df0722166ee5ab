#include "modelling/identification/equation/heat_fit.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "config/runs/model_inputs.hpp"
#include "estimator/model/terms/low_pass.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t heats_max = 4;
constexpr double gain_min = 0.05;
constexpr std::array<double, 6> all_taus_s{60.0, 300.0, 900.0, 2700.0, 8100.0, 24300.0};

constexpr std::size_t starts_min = 3;
constexpr double starts_apart_K = 1.0;

/// Multiplies the column by a place's temperature relative to the mean of the runs' starts.
HeatColumn by_start(const MeasuredTests& tests, HeatColumn column, std::size_t place,
                    bool at_start) {
  double sum_degC = 0.0;
  for (const TestRun& run : tests.runs)
    sum_degC += run.reference_degC[static_cast<Eigen::Index>(place)];
  column.factor = {place, at_start, sum_degC / static_cast<double>(tests.runs.size())};
  return column;
}

void add_starts(const MeasuredTests& tests, const Equation& equation,
                std::vector<HeatColumn>& all) {
  std::vector<HeatColumn> acting;
  for (const FitColumn& column : equation.columns)
    if (!(column.tau_s > 0)) acting.push_back({0, 1.0, 0.0, {}, column.place});
  if (acting.empty()) return;
  const std::size_t first = *acting.front().place;
  for (const HeatColumn& heat : all)
    if (heat.power < 1.5) acting.push_back(heat);
  const auto room = static_cast<std::size_t>(
      std::find_if(tests.places.begin(), tests.places.end(), is_called_like_a_room) -
      tests.places.begin());
  for (const HeatColumn& column : acting) {
    const std::size_t own = column.place.value_or(first);
    if (starts_differ(tests, own)) all.push_back(by_start(tests, column, own, true));
    if (room < tests.places.size() && room != own && starts_differ(tests, room))
      all.push_back(by_start(tests, column, room, false));
  }
}

std::vector<HeatColumn> candidates(const MeasuredTests& tests, const Equation& equation) {
  double longest_s = 0.0;
  for (const TestRun& run : tests.runs)
    longest_s = std::max(longest_s, run.time_s[run.time_s.size() - 1] - run.time_s[0]);
  std::vector<HeatColumn> all;
  for (std::size_t signal = 0; signal < tests.signals.size(); ++signal) {
    if (!tests.moved(tests.signals[signal])) continue;
    for (const double power : {1.0, 2.0})
      for (const double tau_s : all_taus_s)
        if (tau_s <= longest_s / 3.0) all.push_back({signal, power, tau_s});
  }
  add_starts(tests, equation, all);
  return all;
}

/// X'X of each fold; order: chosen columns, candidates, outputs.
std::vector<Eigen::MatrixXd> equations(const MeasuredTests& tests, const Equation& equation,
                                       const std::vector<HeatColumn>& heats) {
  const auto own = static_cast<Eigen::Index>(equation.columns.size());
  const auto count = static_cast<Eigen::Index>(heats.size());
  const auto outputs = static_cast<Eigen::Index>(tests.outputs.size());
  std::vector<Eigen::MatrixXd> rows;
  for (const TestRun& run : tests.runs) {
    Eigen::MatrixXd& all = rows.emplace_back(run.time_s.size(), own + count + outputs);
    for (Eigen::Index i = 0; i < own; ++i)
      all.col(i) = column_of(run, equation.columns[static_cast<std::size_t>(i)]);
    for (Eigen::Index i = 0; i < count; ++i)
      all.col(own + i) = column_of(run, heats[static_cast<std::size_t>(i)]);
    all.rightCols(outputs) = run.outputs_um;
  }
  std::vector<Eigen::MatrixXd> folds;
  for (const Fold& fold : tests.folds) {
    const auto part = rows[fold.run].middleRows(fold.begin, fold.end - fold.begin);
    folds.emplace_back(part.transpose() * part);
  }
  return folds;
}

/// Least squares with a relative ridge of 1e-9, which keeps singular equations finite.
Eigen::MatrixXd solved(const Eigen::MatrixXd& total, const std::vector<Eigen::Index>& x,
                       Eigen::Index outputs) {
  Eigen::MatrixXd a = total(x, x);
  a.diagonal() *= 1.0 + 1e-9;
  a.diagonal().array() += 1e-30;
  const Eigen::VectorXd scale = a.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd y = total(x, Eigen::seqN(total.cols() - outputs, outputs));
  return scale.asDiagonal() *
         (scale.asDiagonal() * a * scale.asDiagonal()).ldlt().solve(scale.asDiagonal() * y);
}

/// Left-out sum of squares per fold, each output relative to its total.
std::vector<double> scores(const std::vector<Eigen::MatrixXd>& folds, const Eigen::MatrixXd& total,
                           const std::vector<Eigen::Index>& x, Eigen::Index outputs) {
  std::vector<double> result;
  for (const Eigen::MatrixXd& fold : folds) {
    const Eigen::MatrixXd b = solved(total - fold, x, outputs);
    double sum = 0.0;
    for (Eigen::Index o = 0; o < outputs; ++o) {
      const Eigen::Index y = fold.cols() - outputs + o;
      const Eigen::VectorXd own = fold(x, x) * b.col(o) - 2.0 * fold(x, y);
      sum += (fold(y, y) + b.col(o).dot(own)) / std::max(total(y, y), 1e-30);
    }
    result.push_back(sum);
  }
  return result;
}

}  // namespace

bool starts_differ(const MeasuredTests& tests, std::size_t place) {
  std::vector<double> starts_degC;
  for (const TestRun& run : tests.runs)
    starts_degC.push_back(run.reference_degC[static_cast<Eigen::Index>(place)]);
  const auto [least, most] = std::minmax_element(starts_degC.begin(), starts_degC.end());
  return starts_degC.size() >= starts_min && *most - *least >= starts_apart_K;
}

Eigen::VectorXd column_of(const TestRun& run, const HeatColumn& column) {
  Eigen::VectorXd heat =
      column.place ? Eigen::VectorXd(run.places_K.col(static_cast<Eigen::Index>(*column.place)))
                   : Eigen::VectorXd(run.signals.col(static_cast<Eigen::Index>(column.signal)));
  if (column.power > 1.5) heat = heat.cwiseAbs2().eval();
  LowPass late(column.tau_s);
  for (Eigen::Index row = 0; row < heat.size(); ++row)
    heat[row] = late.step(
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(run.time_s[row])),
        heat[row]);
  if (column.factor) {
    const auto place = static_cast<Eigen::Index>(column.factor->place);
    const double above_K = run.reference_degC[place] - column.factor->place0_degC;
    if (column.factor->at_start)
      heat *= above_K;
    else
      heat.array() *= above_K + run.places_K.col(place).array();
  }
  return heat.array() - double(heat[0]);
}

HeatEquation add_heats(const MeasuredTests& tests, const Equation& equation) {
  const std::vector<HeatColumn> all = candidates(tests, equation);
  const std::vector<Eigen::MatrixXd> folds = equations(tests, equation, all);
  const Eigen::MatrixXd total =
      std::accumulate(folds.begin() + 1, folds.end(), Eigen::MatrixXd(folds[0]));
  const auto outputs = static_cast<Eigen::Index>(tests.outputs.size());
  const auto own = static_cast<Eigen::Index>(equation.columns.size());
  HeatEquation result{equation.columns, {}, {}};
  std::vector<Eigen::Index> x(equation.columns.size());
  std::iota(x.begin(), x.end(), 0);
  const auto sum = [](const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
  };
  std::vector<double> before = scores(folds, total, x, outputs);
  while (result.heats.size() < heats_max) {
    std::vector<double> best = before;
    std::size_t found = all.size();
    x.push_back(0);
    for (std::size_t i = 0; i < all.size(); ++i) {
      x.back() = own + static_cast<Eigen::Index>(i);
      if (std::count(x.begin(), x.end(), x.back()) > 1) continue;
      const std::vector<double> with = scores(folds, total, x, outputs);
      if (!(sum(with) < sum(best)) || !helps_on_most(before, with)) continue;
      best = with;
      found = i;
    }
    x.pop_back();
    if (found == all.size() || !(sum(best) <= (1.0 - gain_min) * sum(before))) break;
    x.push_back(own + static_cast<Eigen::Index>(found));
    result.heats.push_back(all[found]);
    before = best;
  }
  result.coefficients = solved(total, x, outputs);
  return result;
}

}  // namespace thermocomp::identification
