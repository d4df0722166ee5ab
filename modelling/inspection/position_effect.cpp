#include "modelling/inspection/position_effect.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "config/text/units.hpp"
#include "modelling/inspection/robust.hpp"

namespace thermocomp::inspection {
namespace {

using Eigen::Index;

constexpr Index half_window = 3;
constexpr Index rows_a_column_min = 10;
constexpr Index rows_max = 4000;  // of the regression; a long run says no more with all of its rows
constexpr int rounds = 8;
constexpr double huber_deviations = 1.5;

Eigen::VectorXd as_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Index>(values.size()));
}

/// Columns with the spread 1 about 0, so that one small penalty suits all of them.
Eigen::VectorXd scaled(Eigen::VectorXd column) {
  std::vector<double> present(column.begin(), column.end());
  const double middle = median(std::move(present));
  column.array() -= middle;
  double largest = 0.0;
  for (const double value : column)
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  if (largest > 0) column /= largest;
  return column;
}

/// p, p^2 and p T for each position p and each temperature T.
Eigen::MatrixXd position_columns(const RunFile& run, bool with_temperatures) {
  std::vector<Eigen::VectorXd> temperatures;
  std::vector<Eigen::VectorXd> columns;
  for (std::size_t i = 0; with_temperatures && i < run.columns.size(); ++i)
    if (is_temperature(run.columns[i])) temperatures.push_back(scaled(as_vector(run.values[i])));
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (unit_of(run.columns[i]).symbol != "mm") continue;
    const Eigen::VectorXd position = scaled(as_vector(run.values[i]));
    columns.push_back(position);
    columns.emplace_back(position.cwiseAbs2());
    for (const Eigen::VectorXd& temperature : temperatures)
      columns.emplace_back(position.cwiseProduct(temperature));
  }
  Eigen::MatrixXd matrix(static_cast<Index>(run.rows()), static_cast<Index>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) matrix.col(static_cast<Index>(i)) = columns[i];
  return matrix;
}

std::vector<Index> complete_rows(const Eigen::MatrixXd& columns,
                                 const std::vector<double>& displacement) {
  std::vector<Index> rows;
  for (Index row = 0; row < columns.rows(); ++row)
    if (std::isfinite(displacement[static_cast<std::size_t>(row)]) && columns.row(row).allFinite())
      rows.push_back(row);
  return rows;
}

bool enough(const std::vector<Index>& rows, const Eigen::MatrixXd& columns) {
  return columns.cols() > 0 &&
         static_cast<Index>(rows.size()) >= rows_a_column_min * columns.cols() + 2 * half_window;
}

/// Each of the given rows less the mean of the seven around it. Shape (rows, columns)
Eigen::MatrixXd fast_part(const Eigen::MatrixXd& columns, const std::vector<Index>& rows) {
  const auto count = static_cast<Index>(rows.size());
  const Index stride = (count + rows_max - 1) / rows_max;
  Eigen::MatrixXd fast((count - 2 * half_window + stride - 1) / stride, columns.cols());
  for (Index i = 0; i < fast.rows(); ++i) {
    const Index middle = half_window + i * stride;
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(columns.cols());
    for (Index j = middle - half_window; j <= middle + half_window; ++j)
      sum += columns.row(rows[static_cast<std::size_t>(j)]);
    fast.row(i) = columns.row(rows[static_cast<std::size_t>(middle)]) - sum / (2 * half_window + 1);
  }
  return fast;
}

Eigen::VectorXd robust_fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(y.size());
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(x.cols());
  for (int round = 0; round < rounds; ++round) {
    Eigen::MatrixXd normal = x.transpose() * weights.asDiagonal() * x;
    // Temperatures that move alike make columns alike; together they say what one of them does.
    normal.diagonal().array() += 1e-6 * normal.diagonal().maxCoeff() + 1e-300;
    coefficients = normal.ldlt().solve(x.transpose() * weights.asDiagonal() * y);
    const Eigen::VectorXd rest = y - x * coefficients;
    const double deviation = huber_deviations * robust_deviation(rest);
    if (!(deviation > 0)) break;
    weights = (deviation / rest.array().abs().max(deviation)).matrix();
  }
  return coefficients;
}

}  // namespace

std::vector<double> position_effect(const RunFile& run, std::size_t column) {
  std::vector<double> effect(run.rows(), 0.0);
  Eigen::MatrixXd columns = position_columns(run, true);
  std::vector<Index> rows = complete_rows(columns, run.values[column]);
  if (!enough(rows, columns)) {
    columns = position_columns(run, false);
    rows = complete_rows(columns, run.values[column]);
    if (!enough(rows, columns)) return effect;
  }
  const Eigen::VectorXd fast_y = fast_part(as_vector(run.values[column]), rows);
  const Eigen::VectorXd coefficients = robust_fit(fast_part(columns, rows), fast_y);
  for (const Index row : rows)
    effect[static_cast<std::size_t>(row)] = columns.row(row).dot(coefficients);
  return effect;
}

}  // namespace thermocomp::inspection
