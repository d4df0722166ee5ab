#include "modelling/diagnosis/series.hpp"

#include <algorithm>

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
