#include "modelling/diagnosis/sensor_witness.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/low_pass.hpp"

namespace thermocomp::diagnosis {
namespace {

/// More than this is not believed of one witness: lags and neighbours explain a reading only so
/// far.
constexpr double support_max = 400.0;

Column late(const MeasuredRun& run, const Column& values, double tau_s) {
  LowPass filter(tau_s);
  Column out(values.size());
  for (Eigen::Index row = 0; row < values.size(); ++row)
    out[row] = filter.step(
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(run.time_s[row])),
        values[row]);
  return out;
}

/// What the reading is predicted from, over the rows of one run.
Eigen::MatrixXd neighbours(const MeasuredData& data, const MeasuredRun& run, std::size_t sensor) {
  std::vector<Column> columns = {Column::Ones(run.rows())};
  const auto add = [&](const Column& values, std::initializer_list<double> lags_s) {
    for (const double tau_s : lags_s) columns.push_back(late(run, values, tau_s));
  };
  for (std::size_t input = 0; input < data.model.inputs.size(); ++input)
    if (input != sensor) add(run.inputs_K[input], {0.0, 1800.0});
  for (const Column& other : run.others_K) add(other, {0.0, 1800.0});
  for (const Column& signal : run.signals) add(signal, {600.0, 3600.0});
  Eigen::MatrixXd all(run.rows() - run.begin, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i)
    all.col(static_cast<Eigen::Index>(i)) = columns[i].tail(all.rows());
  return all;
}

/// The error of the reading that the fault supposes, over the rows of its run.
Column supposed_error(const Explanation& fault, const MeasuredRun& run, const Block& rows,
                      const MeasuredData& data) {
  // The explanation's column is -K times the error (for unit gain).
  for (std::size_t output = 0; output < fault.gains.size(); ++output) {
    if (fault.gains[output].size() == 0) continue;
    const Column factor =
        data.coefficient(run, output, *fault.hypothesis->sensor).tail(rows.end - rows.begin);
    if (!(factor.cwiseAbs().minCoeff() > 0)) continue;
    const Panel columns = fault.hypothesis->columns({fault.shape}, output);
    return -columns.col(0).segment(rows.begin, rows.end - rows.begin).cwiseQuotient(factor) *
           fault.gains[output][0];
  }
  return Column::Zero(rows.end - rows.begin);
}

}  // namespace

double sensor_says(const MeasuredData& data, const StackedRows& rows, const Explanation& fault) {
  const std::size_t run_index = *fault.hypothesis->run;
  const MeasuredRun& run = data.runs[run_index];
  const Block& block = rows.runs[run_index];
  const Eigen::Index count = block.end - block.begin;
  Eigen::MatrixXd from = neighbours(data, run, *fault.hypothesis->sensor);
  const Column reading_K = run.inputs_K[*fault.hypothesis->sensor].tail(count);
  const Column error_K = supposed_error(fault, run, block, data);
  if (!(error_K.cwiseAbs().maxCoeff() > 0)) return -support_max;
  for (Eigen::Index column = 0; column < from.cols(); ++column) {
    const double scale = from.col(column).cwiseAbs().maxCoeff();
    if (scale > 0) from.col(column) /= scale;
  }
  StackedRows alone;
  alone.time_s = run.time_s.tail(count);
  alone.runs = {{0, count}};
  alone.blocks = alone.runs;
  const Eigen::Array<bool, Eigen::Dynamic, 1> present =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(count, true);
  const Eigen::VectorXd precision = Eigen::VectorXd::Constant(from.cols(), 1e-6);
  double best_without = -1e300;
  double best_with = -1e300;
  for (const double ratio : {1.0, 30.0, 1000.0}) {
    for (const double tau_s : {600.0, 3600.0, 20000.0}) {
      const Setting setting({ratio, tau_s}, alone, present, reading_K, from, precision);
      const Setting::Equations of = setting.equations(error_K);
      const double with = setting.squares() - 2.0 * of.right[0] + of.square(0, 0);
      best_without = std::max(best_without, setting.twice_log_likelihood(setting.squares()));
      best_with = std::max(best_with, setting.twice_log_likelihood(with));
    }
  }
  return std::clamp(best_with - best_without, -support_max, support_max);
}

}  // namespace thermocomp::diagnosis
