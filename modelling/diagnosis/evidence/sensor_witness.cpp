#include "modelling/diagnosis/evidence/sensor_witness.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "estimator/model/terms/low_pass.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// More than this is not believed of one witness: lags and neighbours explain a reading only so
/// far.
constexpr double support_max = 400.0;
/// Of each coefficient of a prediction: the noise's variance over the prior's.
constexpr double precision = 1e-6;
/// A sensor's columns: its reading, and the reading late.
constexpr Eigen::Index columns_of_sensor = 2;

Column late(const MeasuredRun& run, const Column& values, double tau_s) {
  LowPass filter(tau_s);
  Column out(values.size());
  for (Eigen::Index row = 0; row < values.size(); ++row)
    out[row] = filter.step(
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(run.time_s[row])),
        values[row]);
  return out;
}

/// What readings are predicted from, over the selected rows of a run.
Panel predictors(const MeasuredRun& run) {
  std::vector<Column> columns = {Column::Ones(run.rows())};
  const auto add = [&](const Column& values, std::initializer_list<double> lags_s) {
    for (const double tau_s : lags_s) columns.push_back(late(run, values, tau_s));
  };
  for (const Column& other : run.others_K) add(other, {0.0, 1800.0});
  for (const Column& signal : run.signals) add(signal, {600.0, 3600.0});
  for (const Column& input : run.inputs_K) add(input, {0.0, 1800.0});
  Panel all(run.rows() - run.begin, std::ssize(columns));
  for (std::size_t i = 0; i < columns.size(); ++i)
    all.col(static_cast<Eigen::Index>(i)) = columns[i].tail(all.rows());
  return all;
}

/// The error of the reading that the fault supposes, over the selected rows of its run.
Column supposed_error(const Explanation& fault, const MeasuredRun& run, const Block& rows,
                      const MeasuredData& data) {
  const Hypothesis& of = *fault.hypothesis;
  const Eigen::Index count = rows.end - rows.begin;
  const ErrorOfReading error = cause_named(of.cause).error_of_reading;
  for (const Eigen::VectorXd& gains : fault.gains)
    if (gains.size() > 0)
      return error(data, run, *of.sensor, fault.shape[0]).tail(count) * gains[0];
  return Column::Zero(count);
}

/// The factor of products as it is without the first columns of `rows`: rotations put each of them
/// into those after it.
/// @param rows  of a lower factor, from the columns to be left out on, and of others beside it;
///        changed
void leave_out_first(Eigen::MatrixXd& rows, Eigen::Index count) {
  for (Eigen::Index out = count; out-- > 0;)
    for (Eigen::Index column = count; column < rows.cols(); ++column) {
      const Eigen::Index below = rows.rows() - column;
      const double radius = std::hypot(rows(column, column), rows(column, out));
      const double cosine = rows(column, column) / radius;
      const double sine = rows(column, out) / radius;
      double* kept = &rows(column, column);
      double* left = &rows(column, out);
      for (Eigen::Index row = 0; row < below; ++row) {
        const double now = kept[row];
        kept[row] = cosine * now + sine * left[row];
        left[row] = cosine * left[row] - sine * now;
      }
    }
}

}  // namespace

SensorWitness::SensorWitness(const MeasuredData& data, const StackedRows& rows)
    : data_(data), rows_(rows) {}

const SensorWitness::Run& SensorWitness::run(std::size_t index) {
  const auto known = runs_.find(index);
  if (known != runs_.end()) return known->second;
  return runs_.emplace(index, made(data_.runs[index])).first->second;
}

SensorWitness::Run SensorWitness::made(const MeasuredRun& run) const {
  Run of;
  of.columns = predictors(run);
  of.size = of.columns.cwiseAbs().colwise().maxCoeff();
  of.size = (of.size.array() > 0).select(of.size, 1.0);
  of.columns.array().rowwise() /= of.size.array().transpose();
  const Column time_s = run.time_s.tail(of.columns.rows());
  const Eigen::Array<bool, Eigen::Dynamic, 1> present =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(time_s.size(), true);
  for (const double ratio : {1.0, 30.0, 1000.0}) {
    for (const double tau_s : {600.0, 3600.0, 20000.0}) {
      Whitener whitener({ratio, tau_s}, time_s, {{0, time_s.size()}}, present);
      const Panel white = whitener.apply(of.columns);
      Eigen::MatrixXd products = cross_products(white, white, 0, white.rows());
      Eigen::MatrixXd square = products;
      square.diagonal().array() += precision;
      Eigen::MatrixXd factor = square.llt().matrixL();
      of.noises.push_back({std::move(whitener), std::move(products), std::move(factor)});
    }
  }
  return of;
}

std::vector<SensorWitness::Beside> SensorWitness::beside(const Run& run, const Column& error_K) {
  std::vector<Beside> all(run.noises.size());
  Panel errors(error_K.size(), std::ssize(all));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Panel white = run.noises[i].whitener.apply(Panel(error_K));
    all[i].square = white.squaredNorm();
    errors.col(static_cast<Eigen::Index>(i)) = run.noises[i].whitener.transposed(white);
  }
  const Eigen::MatrixXd products = cross_products(run.columns, errors, 0, errors.rows());
  for (std::size_t i = 0; i < all.size(); ++i)
    all[i].products = products.col(static_cast<Eigen::Index>(i));
  return all;
}

Eigen::Index SensorWitness::column_of(const Run& run, std::size_t sensor) const {
  const std::size_t from_the_end = data_.model.inputs.size() - sensor;
  return run.columns.cols() - columns_of_sensor * static_cast<Eigen::Index>(from_the_end);
}

// With L the factor of the predictors' products and the prior, what a prediction takes of the
// products of a and b is (L^-1 X'a)' (L^-1 X'b). L^-1 X'a is one row more of the factor of the
// products bordered with a, of which the reading's own columns are left out like of the others.
SensorWitness::Likelihood SensorWitness::likelihood(const Run& run, const UnderNoise& noise,
                                                    const Beside& error, Eigen::Index reading,
                                                    double times) {
  const Eigen::Index columns = noise.factor.cols();
  const Eigen::Index tail = columns - reading;
  const double size = run.size[reading];
  Eigen::MatrixXd border(columns, 2);
  border << noise.products.col(reading) * size, error.products * times;
  noise.factor.triangularView<Eigen::Lower>().solveInPlace(border);
  Eigen::MatrixXd rows(tail + 2, tail);
  rows << noise.factor.bottomRightCorner(tail, tail), border.bottomRows(tail).transpose();
  leave_out_first(rows, columns_of_sensor);
  const Eigen::Index kept = tail - columns_of_sensor;
  Eigen::MatrixXd shared(columns - columns_of_sensor, 2);
  shared << border.topRows(reading), rows.bottomRightCorner(2, kept).transpose();
  const Eigen::Matrix2d taken = shared.transpose() * shared;
  const double without = noise.products(reading, reading) * size * size - taken(0, 0);
  const double both = error.products[reading] * times * size - taken(0, 1);
  const double with = without - 2.0 * both + error.square * times * times - taken(1, 1);
  const double log_determinant =
      noise.whitener.log_determinant() -
      static_cast<double>(columns - columns_of_sensor) * std::log(precision) +
      2.0 * (noise.factor.diagonal().head(reading).array().log().sum() +
             rows.diagonal().tail(kept).array().log().sum());
  const auto count = static_cast<double>(run.columns.rows());
  const auto twice_log = [&](double squares) {
    return -count * std::log(std::max(squares, 1e-9 * count) / count) - log_determinant;
  };
  return {twice_log(without), twice_log(with)};
}

std::vector<double> SensorWitness::says(const Explanation& fault,
                                        const std::vector<Accused>& accused) {
  const std::size_t index = *fault.hypothesis->run;
  const Column error_K = supposed_error(fault, data_.runs[index], rows_.runs[index], data_);
  if (!(error_K.cwiseAbs().maxCoeff() > 0))
    return std::vector<double>(accused.size(), -support_max);
  const Run& of = run(index);
  const std::vector<Beside> errors = beside(of, error_K);
  std::vector<double> all;
  for (const Accused& each : accused) {
    Likelihood best{-1e300, -1e300};
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const Likelihood here =
          likelihood(of, of.noises[i], errors[i], column_of(of, each.sensor), each.times);
      best.without = std::max(best.without, here.without);
      best.with = std::max(best.with, here.with);
    }
    all.push_back(std::clamp(best.with - best.without, -support_max, support_max));
  }
  return all;
}

}  // namespace thermocomp::diagnosis
