#include "modelling/diagnosis/series.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/low_pass.hpp"

namespace thermocomp::diagnosis {

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
  const Column backwards_s = -time_s.reverse();
  const Column there = through(LowPass(tau_s), time_s, values).reverse();
  return through(LowPass(tau_s), backwards_s, there).reverse();
}

Column calm(const Column& time_s, const Column& values) {
  const Eigen::Index last = values.size() - 1;
  Column best = values;
  if (last < 8) return best;
  // Without smoothing a row is predicted from its two neighbours.
  double least = 0.0;
  for (Eigen::Index row = 1; row < last; ++row)
    least += std::pow(values[row] - 0.5 * (values[row - 1] + values[row + 1]), 2);
  const double step_s = (time_s[last] - time_s[0]) / static_cast<double>(last);
  for (const double rows : {1.0, 2.0, 4.0, 8.0}) {
    Column smooth = smoothed(time_s, values, rows * step_s);
    // Weight of a value in its own smoothed one.
    const double share = -std::expm1(-1.0 / rows);
    const double own = share / (2.0 - share);
    const double left = ((values - smooth) / (1.0 - own)).segment(1, last - 1).squaredNorm();
    if (!(left < least)) continue;
    least = left;
    best = std::move(smooth);
  }
  return best;
}

Column slope_per_s(const Column& time_s, const Column& values, double tau_s) {
  const Column smooth = smoothed(time_s, values, tau_s);
  const Eigen::Index last = values.size() - 1;
  Column slope = Column::Zero(values.size());
  for (Eigen::Index row = 0; row <= last && last > 0; ++row) {
    const Eigen::Index low = std::max<Eigen::Index>(0, row - 1);
    const Eigen::Index high = std::min(last, row + 1);
    slope[row] = (smooth[high] - smooth[low]) / (time_s[high] - time_s[low]);
  }
  return slope;
}

}  // namespace thermocomp::diagnosis
