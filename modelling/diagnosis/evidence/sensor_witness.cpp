#include "modelling/diagnosis/evidence/sensor_witness.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "estimator/model/terms/low_pass.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// More than this is not believed of one witness: lags and neighbours explain a reading only so
/// far. Large enough that faults of one reading are told from each other.
constexpr double support_max = 1500.0;
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

/// What readings are predicted from, over the selected rows of a run, without its level.
std::vector<Column> predictors(const MeasuredRun& run) {
  std::vector<Column> columns;
  const auto add = [&](const Column& values, std::initializer_list<double> lags_s) {
    for (const double tau_s : lags_s) columns.push_back(late(run, values, tau_s));
  };
  for (const Column& other : run.others_K) add(other, {0.0, 1800.0});
  for (const Column& signal : run.signals) add(signal, {600.0, 3600.0});
  for (const Column& input : run.inputs_K) add(input, {0.0, 1800.0});
  return columns;
}

/// Over the rows of all runs: a level of each run first.
Panel predictors(const MeasuredData& data, const StackedRows& rows) {
  Panel all;
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const std::vector<Column> columns = predictors(data.runs[i]);
    const Eigen::Index levels = std::ssize(data.runs);
    if (i == 0) all = Panel::Zero(rows.time_s.size(), levels + std::ssize(columns));
    const Block& block = rows.runs[i];
    const Eigen::Index count = block.end - block.begin;
    all.col(static_cast<Eigen::Index>(i)).segment(block.begin, count).setOnes();
    for (std::size_t k = 0; k < columns.size(); ++k)
      all.col(levels + static_cast<Eigen::Index>(k)).segment(block.begin, count) =
          columns[k].tail(count);
  }
  return all;
}

/// The one gain of a fault of a reading; 0 where it acts on no output.
double acting_gain(const Explanation& fault) {
  const auto acting = std::find_if(fault.gains.begin(), fault.gains.end(),
                                   [](const Eigen::VectorXd& gains) { return gains.size() > 0; });
  return acting == fault.gains.end() ? 0.0 : (*acting)[0];
}

/// The error of the reading that the fault supposes; 0 outside its run.
Column supposed_error(const Explanation& fault, const MeasuredData& data, const StackedRows& rows) {
  const Hypothesis& of = *fault.hypothesis;
  const Block& block = rows.runs[*of.run];
  const Eigen::Index count = block.end - block.begin;
  const ErrorOfReading error = cause_named(of.cause).error_of_reading;
  Column all = Column::Zero(rows.time_s.size());
  all.segment(block.begin, count) =
      error(data, data.runs[*of.run], *of.sensor, fault.shape[0]).tail(count) * acting_gain(fault);
  return all;
}

/// Of the reading's motion in each row, 1 outside the fault.
Column share_left(const Explanation& fault, const StackedRows& rows) {
  const double lost = acting_gain(fault);
  const Block& block = rows.runs[*fault.hypothesis->run];
  Column left = Column::Ones(rows.time_s.size());
  for (Eigen::Index row = block.begin; row < block.end; ++row)
    if (rows.time_s[row] >= fault.shape[0]) left[row] = 1.0 / (1.0 + lost);
  return left;
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

const SensorWitness::Readings& SensorWitness::readings() {
  if (!readings_) readings_ = made();
  return *readings_;
}

SensorWitness::Readings SensorWitness::made() const {
  Readings of;
  of.columns = predictors(data_, rows_);
  of.size = of.columns.cwiseAbs().colwise().maxCoeff();
  of.size = (of.size.array() > 0).select(of.size, 1.0);
  of.columns.array().rowwise() /= of.size.array().transpose();
  const Eigen::Array<bool, Eigen::Dynamic, 1> present =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(rows_.time_s.size(), true);
  for (const double ratio : {1.0, 30.0, 1000.0}) {
    for (const double tau_s : {600.0, 3600.0, 20000.0}) {
      Whitener whitener({ratio, tau_s}, rows_.time_s, rows_.runs, present);
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

std::vector<SensorWitness::Beside> SensorWitness::beside(const Readings& readings,
                                                         const Column& error_K) {
  std::vector<Beside> all(readings.noises.size());
  Panel errors(error_K.size(), std::ssize(all));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Panel white = readings.noises[i].whitener.apply(Panel(error_K));
    all[i].square = white.squaredNorm();
    errors.col(static_cast<Eigen::Index>(i)) = readings.noises[i].whitener.transposed(white);
  }
  const Eigen::MatrixXd products = cross_products(readings.columns, errors, 0, errors.rows());
  for (std::size_t i = 0; i < all.size(); ++i)
    all[i].products = products.col(static_cast<Eigen::Index>(i));
  return all;
}

Eigen::Index SensorWitness::column_of(const Readings& readings, std::size_t sensor) const {
  const std::size_t from_the_end = data_.model.inputs.size() - sensor;
  return readings.columns.cols() - columns_of_sensor * static_cast<Eigen::Index>(from_the_end);
}

// With L the factor of the predictors' products and the prior, what a prediction takes of the
// products of a and b is (L^-1 X'a)' (L^-1 X'b). L^-1 X'a is one row more of the factor of the
// products bordered with a, of which the reading's own columns are left out like of the others.
SensorWitness::Likelihood SensorWitness::likelihood(const Readings& readings,
                                                    const UnderNoise& noise, const Beside& error,
                                                    Eigen::Index reading, double times) {
  const Eigen::Index columns = noise.factor.cols();
  const Eigen::Index tail = columns - reading;
  const double size = readings.size[reading];
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
  const auto count = static_cast<double>(readings.columns.rows());
  const auto twice_log = [&](double squares) {
    return -count * std::log(std::max(squares, 1e-9 * count) / count) - log_determinant;
  };
  return {twice_log(without), twice_log(with), log_determinant};
}

// reading = room + left (T - room) + noise. The corrected one, (reading - (1 - left) room) / left,
// has noise of 1 / left times the size; what the prediction leaves of it is weighed by `left`, and
// the factors of the density, product of 1 / left, cancel against those of the covariance.
double SensorWitness::likelihood_of_shrunk(const Readings& readings, const UnderNoise& noise,
                                           Eigen::Index reading, const Column& corrected_K,
                                           const Column& left, double log_determinant) {
  const auto solved = [&](Eigen::MatrixXd of) {
    noise.factor.triangularView<Eigen::Lower>().solveInPlace(of);
    noise.factor.transpose().triangularView<Eigen::Upper>().solveInPlace(of);
    return of;
  };
  const Panel white = noise.whitener.apply(Panel(corrected_K));
  const Eigen::MatrixXd products =
      readings.columns.transpose() * noise.whitener.transposed(white).col(0);
  // The reading's own coefficients are kept at zero by Lagrange multipliers.
  const Eigen::MatrixXd free = solved(products);
  const Eigen::MatrixXd held =
      solved(Eigen::MatrixXd::Identity(noise.factor.rows(), noise.factor.cols())
                 .middleCols(reading, columns_of_sensor));
  const Eigen::MatrixXd multipliers = held.middleRows(reading, columns_of_sensor)
                                          .ldlt()
                                          .solve(free.middleRows(reading, columns_of_sensor));
  const Column rest = corrected_K - readings.columns * (free - held * multipliers).col(0);
  const Column of = noise.whitener.apply(rest).cwiseProduct(left);
  const auto count = static_cast<double>(rest.size());
  return -count * std::log(std::max(of.squaredNorm(), 1e-9 * count) / count) - log_determinant;
}

std::vector<double> SensorWitness::says(const Explanation& fault,
                                        const std::vector<Accused>& accused) {
  const Column error_K = supposed_error(fault, data_, rows_);
  if (!(error_K.cwiseAbs().maxCoeff() > 0))
    return std::vector<double>(accused.size(), -support_max);
  const Readings& of = readings();
  const std::vector<Beside> errors = beside(of, error_K);
  const bool shrinks = cause_named(fault.hypothesis->cause).shrinks_reading;
  const Column left = shrinks ? share_left(fault, rows_) : Column();
  std::vector<double> all;
  for (const Accused& each : accused) {
    Likelihood best{-1e300, -1e300, 0.0};
    const Eigen::Index column = column_of(of, each.sensor);
    const auto shrunk = [&](double log_determinant, std::size_t noise) {
      return likelihood_of_shrunk(of, of.noises[noise], column,
                                  of.columns.col(column) * of.size[column] - error_K * each.times,
                                  left, log_determinant);
    };
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const Likelihood here = likelihood(of, of.noises[i], errors[i], column, each.times);
      best.without = std::max(best.without, here.without);
      best.with = std::max(best.with, shrinks ? shrunk(here.log_determinant, i) : here.with);
    }
    all.push_back(std::clamp(best.with - best.without, -support_max, support_max));
  }
  return all;
}

}  // namespace thermocomp::diagnosis
