#include "modelling/diagnosis/data/series.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace thermocomp::diagnosis {

Panel lagged(const Column& time_s, const Column& values, const std::vector<double>& taus_s) {
  const Eigen::Map<const Eigen::ArrayXd> taus(taus_s.data(), std::ssize(taus_s));
  Panel out(values.size(), taus.size());
  if (values.size() == 0) return out;
  out.row(0).setConstant(values[0]);
  Eigen::ArrayXd shares = Eigen::ArrayXd::Ones(taus.size());
  double step_s = -1.0;
  for (Eigen::Index row = 1; row < values.size(); ++row) {
    if (const double now_s = time_s[row] - time_s[row - 1]; now_s != step_s) {
      step_s = now_s;
      shares = (taus > 0).select(-(-step_s / taus.max(1e-300)).expm1(), 1.0);
    }
    out.row(row) =
        out.row(row - 1).array() + shares.transpose() * (values[row] - out.row(row - 1).array());
  }
  return out;
}

Column lagged(const Column& time_s, const Column& values, double tau_s) {
  return lagged(time_s, values, std::vector<double>{tau_s}).col(0);
}

Panel played_less_values(const Column& values, const std::vector<double>& widths) {
  const Eigen::ArrayXd half =
      0.5 * Eigen::Map<const Eigen::ArrayXd>(widths.data(), std::ssize(widths));
  Panel out(values.size(), half.size());
  Eigen::ArrayXd at = Eigen::ArrayXd::Constant(half.size(), values.size() > 0 ? values[0] : 0.0);
  for (Eigen::Index row = 0; row < values.size(); ++row) {
    at = at.max(values[row] - half).min(values[row] + half);
    out.row(row) = at - values[row];
  }
  return out;
}

Column shifted(const Column& time_s, const Column& values, double shift_s) {
  Column out(values.size());
  Eigen::Index row = 0;
  const Eigen::Index last = values.size() - 1;
  for (Eigen::Index i = 0; i <= last; ++i) {
    const double t = time_s[i] - shift_s;
    while (row > 0 && time_s[row] > t) --row;
    while (row < last && time_s[row + 1] <= t) ++row;
    if (row == last || t <= time_s[row]) {
      out[i] = values[row];
      continue;
    }
    const double share = (t - time_s[row]) / (time_s[row + 1] - time_s[row]);
    out[i] = values[row] + share * (values[row + 1] - values[row]);
  }
  return out;
}

Column smoothed(const Column& time_s, const Column& values, double tau_s) {
  Column smooth = lagged(time_s, values, tau_s);
  Column back_s = -time_s;
  back_s.reverseInPlace();
  smooth.reverseInPlace();
  smooth = lagged(back_s, smooth, tau_s);
  smooth.reverseInPlace();
  return smooth;
}

Column denoised(const Column& time_s, const Column& values) {
  const Eigen::Index last = values.size() - 1;
  Column best = values;
  if (last < 8) return best;
  // Without smoothing a row is predicted by the mean of its neighbours.
  double least = 0.0;
  for (Eigen::Index row = 1; row < last; ++row)
    least += std::pow(values[row] - 0.5 * (values[row - 1] + values[row + 1]), 2);
  const double step_s = (time_s[last] - time_s[0]) / static_cast<double>(last);
  for (const double rows : {1.0, 2.0, 4.0, 8.0}) {
    const Column smooth = smoothed(time_s, values, rows * step_s);
    // Weight of a value in its smoothed value.
    const double share = -std::expm1(-1.0 / rows);
    const double own = share / (2.0 - share);
    const double left = ((values - smooth) / (1.0 - own)).segment(1, last - 1).squaredNorm();
    if (!(left < least)) continue;
    least = left;
    best = smooth;
  }
  return best;
}

Column slope(const Column& time_s, const Column& values, double tau_s) {
  Column out = Column::Zero(values.size());
  if (values.size() < 2) return out;
  const Column smooth = smoothed(time_s, values, tau_s);
  const Eigen::Index last = values.size() - 1;
  for (Eigen::Index row = 0; row <= last; ++row) {
    const Eigen::Index before = std::max<Eigen::Index>(row - 1, 0);
    const Eigen::Index after = std::min(row + 1, last);
    out[row] = (smooth[after] - smooth[before]) / (time_s[after] - time_s[before]);
  }
  return out;
}

std::vector<double> logarithmic_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low *
                   std::pow(high / low, static_cast<double>(i) / static_cast<double>(count - 1)));
  return grid;
}

std::vector<double> linear_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low + (high - low) * static_cast<double>(i) / static_cast<double>(count - 1));
  return grid;
}

}  // namespace thermocomp::diagnosis
