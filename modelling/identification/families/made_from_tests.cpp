#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "estimator/model/displacement_model.hpp"
#include "estimator/model/terms/low_pass.hpp"
#include "modelling/identification/families/families.hpp"

namespace thermocomp::identification {
namespace {

// Deviation added in quadrature to each feature's, so that a direction without excitation does not
// leave the domain at once: the scatter of good sensors, and a share of a signal's range.
constexpr double level_floor_K = 0.5;
constexpr double signal_floor = 0.05;
/// Limit of the domain relative to the largest distance of the record.
constexpr double beyond_the_record = 1.3;
constexpr std::array<double, 3> domain_taus_s{0.0, 900.0, 8100.0};

nanoseconds time_of(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

struct Feature {
  Eigen::MatrixXd rows;   ///< shape (selected rows, features)
  Eigen::VectorXd floor;  ///< smallest standard deviations
};

/// Column of the model over a run: rise or signal, and the reference of a temperature; zeros if
/// `tests` left it out.
struct Course {
  Eigen::VectorXd values;
  double reference{0.0};
};

Course course_of(const MeasuredTests& tests, const TestRun& run, const std::string& name) {
  const auto place = std::find(tests.places.begin(), tests.places.end(), name);
  if (place != tests.places.end()) {
    const auto at = static_cast<Eigen::Index>(place - tests.places.begin());
    return {run.places_K.col(at), run.reference_degC[at]};
  }
  const auto signal = std::find(tests.signals.begin(), tests.signals.end(), name);
  if (signal == tests.signals.end()) return {Eigen::VectorXd::Zero(run.time_s.size()), 0.0};
  return {run.signals.col(signal - tests.signals.begin()), 0.0};
}

void fill_features(const MeasuredTests& tests, const MadeFrom& made_from, Feature& feature) {
  const std::size_t count = domain_features(made_from);
  Eigen::Index all = 0;
  for (const TestRun& run : tests.between) all += run.time_s.size() - run.begin;
  feature.rows.resize(all, static_cast<Eigen::Index>(count));
  feature.floor.resize(static_cast<Eigen::Index>(count));
  Eigen::Index begin = 0;
  for (const TestRun& run : tests.between) {
    const Eigen::Index rows = run.time_s.size() - run.begin;
    Eigen::Index at = 0;
    for (const std::string& name : made_from.columns) {
      if (!is_temperature_name(name)) continue;
      const Course course = course_of(tests, run, name);
      feature.floor[at] = level_floor_K;
      feature.rows.block(begin, at++, rows, 1) =
          course.values.tail(rows).array() + course.reference;
    }
    for (const double tau_s : made_from.taus_s)
      for (std::size_t i = 0; i < made_from.columns.size(); ++i) {
        const Course course = course_of(tests, run, made_from.columns[i]);
        LowPass late(tau_s);
        Eigen::VectorXd lagged(course.values.size());
        for (Eigen::Index row = 0; row < lagged.size(); ++row)
          lagged[row] = late.step(time_of(run.time_s[row]), course.values[row]);
        const double range = made_from.high[i] - made_from.low[i];
        feature.floor[at] = is_temperature_name(made_from.columns[i])
                                ? level_floor_K
                                : std::max(signal_floor * range, 1e-6);
        feature.rows.block(begin, at++, rows, 1) = lagged.tail(rows);
      }
    begin += rows;
  }
}

void fill_ranges(const MeasuredTests& tests, MadeFrom& made_from) {
  for (const std::string& name : made_from.columns) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const TestRun& run : tests.between) {
      const Course course = course_of(tests, run, name);
      const auto selected = course.values.tail(run.time_s.size() - run.begin);
      low = std::min(low, selected.minCoeff() + course.reference);
      high = std::max(high, selected.maxCoeff() + course.reference);
    }
    made_from.low.push_back(low);
    made_from.high.push_back(high);
  }
}

void fill_domain(const MeasuredTests& tests, MadeFrom& made_from) {
  Feature feature;
  fill_features(tests, made_from, feature);
  const Eigen::RowVectorXd mean = feature.rows.colwise().mean();
  const Eigen::MatrixXd centred = feature.rows.rowwise() - mean;
  Eigen::MatrixXd covariance =
      centred.transpose() * centred / static_cast<double>(feature.rows.rows());
  covariance.diagonal() += feature.floor.cwiseAbs2();
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::MatrixXd white = factor.matrixL().solve(centred.transpose());
  const double furthest = white.colwise().squaredNorm().maxCoeff();
  made_from.distance_max =
      std::max(1.0, beyond_the_record * std::sqrt(furthest / static_cast<double>(white.rows())));
  made_from.mean.assign(mean.data(), mean.data() + mean.size());
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    const Eigen::VectorXd row = covariance.row(i);
    made_from.covariance.emplace_back(row.data(), row.data() + row.size());
  }
}

/// White part of the variance, from second differences; and the time in which the correlation of
/// the rest falls to 1/e.
void fill_noise(const MeasuredTests& tests, const Eigen::VectorXd& left, MadeFrom::Output& output) {
  double second = 0.0;
  double count = 0.0;
  double longest_s = 0.0;
  double step_s = 0.0;
  Eigen::Index begin = 0;
  const auto size = static_cast<double>(left.size());
  const double variance = left.squaredNorm() / size;
  for (const Fold& fold : tests.folds) {
    const Eigen::Index rows = fold.end - fold.begin;
    const Eigen::VectorXd& time_s = tests.runs[fold.run].time_s;
    longest_s = std::max(longest_s, time_s[fold.end - 1] - time_s[fold.begin]);
    if (rows > 1) step_s += (time_s[fold.end - 1] - time_s[fold.begin]) / size;
    for (Eigen::Index row = begin + 2; row < begin + rows; ++row) {
      second += std::pow(left[row] - 2.0 * left[row - 1] + left[row - 2], 2.0) / 6.0;
      count += 1.0;
    }
    begin += rows;
  }
  const double white = count > 0 ? std::min(second / count, variance) : 0.0;
  output.noise_um = std::sqrt(white);
  Eigen::Index lag = 1;
  for (; lag < left.size() / 2; lag *= 2) {
    const auto rows = static_cast<double>(left.size() - lag);
    const double product = left.head(left.size() - lag).dot(left.tail(left.size() - lag)) / rows;
    if (!(product > (variance - white) / 2.718281828459045)) break;
  }
  output.noise_time_s = std::min(longest_s, static_cast<double>(lag) * step_s);
  // Rows closer than the noise's correlation time are not independent.
  const double hours_s = step_s * size;
  output.freedom = std::clamp(hours_s / std::max(2.0 * output.noise_time_s, 1e-9), 1.0, size);
}

}  // namespace

std::vector<double> remainders_um(const MeasuredTests& tests, const ThermalModel& model) {
  std::vector<double> squares(model.outputs.size(), 0.0);
  DisplacementModel displacement(model);
  const std::vector<std::string> temperatures = model.temperature_columns();
  const std::vector<std::string> signals = model.signal_columns();
  std::vector<double> temps(temperatures.size());
  const std::vector<double> reference(temperatures.size(), 0.0);
  std::vector<double> values(signals.size());
  std::vector<double> now_um(model.outputs.size());
  double rows = 0.0;
  for (const Fold& fold : tests.folds) {
    const TestRun& run = tests.runs[fold.run];
    const TestRun& course = tests.course(fold.run);
    const std::vector<Eigen::Index> probed = tests.rows_in_course(fold.run);
    displacement.restart();
    std::vector<Course> courses;
    courses.reserve(temperatures.size() + signals.size());
    for (const std::string& name : temperatures) courses.push_back(course_of(tests, course, name));
    for (const std::string& name : signals) courses.push_back(course_of(tests, course, name));
    std::vector<double> first_um;
    Eigen::Index at = 0;  // row of the run
    for (Eigen::Index row = 0; at < fold.end; ++row) {
      for (std::size_t i = 0; i < temps.size(); ++i) temps[i] = courses[i].values[row];
      for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = courses[temps.size() + i].values[row];
      displacement.step(time_of(course.time_s[row]), temps, reference, values, now_um);
      if (row < probed[static_cast<std::size_t>(at)]) continue;
      if (at == 0) first_um = now_um;
      for (std::size_t o = 0; o < now_um.size() && at >= fold.begin; ++o)
        squares[o] += std::pow(
            run.outputs_um(at, static_cast<Eigen::Index>(o)) - (now_um[o] - first_um[o]), 2.0);
      ++at;
    }
    rows += static_cast<double>(fold.end - fold.begin);
  }
  for (double& each : squares) each = std::sqrt(each / rows);
  return squares;
}

MadeFrom made_from_tests(const MeasuredTests& tests, const FamiliesFit& fit) {
  MadeFrom made_from;
  made_from.rows = static_cast<double>(tests.rows());
  for (const TestRun& run : tests.runs) {
    made_from.runs.push_back(run.name);
    made_from.hours += (run.time_s[run.time_s.size() - 1] - run.time_s[run.begin]) / 3600.0;
  }
  made_from.within_one_run = tests.runs.size() < 2;
  made_from.columns = fit.model.temperature_columns();
  const std::vector<std::string> signals = fit.model.signal_columns();
  made_from.columns.insert(made_from.columns.end(), signals.begin(), signals.end());
  made_from.taus_s.assign(domain_taus_s.begin(), domain_taus_s.end());
  while (made_from.taus_s.size() > 1 && domain_features(made_from) > domain_features_max)
    made_from.taus_s.pop_back();
  fill_ranges(tests, made_from);
  fill_domain(tests, made_from);
  const FamilyResult& chosen = fit.of_model;
  const FamilyResult& none = fit.results.front();
  Eigen::MatrixXd measured(chosen.left_out_um.rows(), chosen.left_out_um.cols());
  Eigen::Index begin = 0;
  for (const Fold& fold : tests.folds) {
    const Eigen::Index rows = fold.end - fold.begin;
    measured.middleRows(begin, rows) = tests.runs[fold.run].outputs_um.middleRows(fold.begin, rows);
    begin += rows;
  }
  const std::vector<double> remainder_um = remainders_um(tests, fit.model);
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    MadeFrom::Output& output = made_from.outputs[tests.outputs[o]];
    const auto at = static_cast<Eigen::Index>(o);
    const Eigen::VectorXd left = measured.col(at) - chosen.left_out_um.col(at);
    fill_noise(tests, left, output);
    output.remainder_rms_um = remainder_um[o];
    output.left_out_rms_um = chosen.left_out_rms_um[o];
    output.no_model_rms_um = none.left_out_rms_um[o];
    if (!fit.other_half_um.empty()) {
      output.left_out_rms_um = fit.other_half_um[o];
      output.freedom = 1.0;  // two halves
    }
  }
  return made_from;
}

}  // namespace thermocomp::identification
