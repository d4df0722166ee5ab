#include "modelling/diagnosis/fit/background.hpp"

#include <cmath>

namespace thermocomp::diagnosis {

const std::vector<Background>& backgrounds() {
  static const std::vector<Background> all = [] {
    std::vector<Background> made = {{0.0, 1.0}};
    for (const double ratio : {2.0, 8.0, 32.0, 128.0})
      for (const double tau_s : {1800.0, 10000.0}) made.push_back({ratio, tau_s});
    return made;
  }();
  return all;
}

double whiten(const Background& background, const Column& time_s, const std::vector<Block>& runs,
              Panel& columns) {
  if (!(background.ratio > 0)) return 0.0;
  const double stationary = background.ratio * background.ratio;
  double log_determinant = 0.0;
  Eigen::RowVectorXd mean(columns.cols());
  for (const Block& run : runs) {
    mean.setZero();
    double variance = stationary;
    for (Eigen::Index row = run.begin; row < run.end; ++row) {
      if (row > run.begin) {
        const double kept = std::exp((time_s[row - 1] - time_s[row]) / background.tau_s);
        mean *= kept;
        variance = stationary + kept * kept * (variance - stationary);
      }
      const double total = variance + 1.0;
      const double root = std::sqrt(total);
      columns.row(row) = (columns.row(row) - mean) / root;
      mean += variance / root * columns.row(row);
      log_determinant += std::log(total);
      variance /= total;
    }
  }
  return log_determinant;
}

}  // namespace thermocomp::diagnosis
