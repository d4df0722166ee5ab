#include "modelling/diagnosis/coloured_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp::diagnosis {

Whitener::Whitener(const NoiseShape& shape, const Eigen::VectorXd& time_s,
                   const std::vector<Block>& blocks,
                   const Eigen::Array<bool, Eigen::Dynamic, 1>& present)
    : keep_(Eigen::VectorXd::Zero(time_s.size())),
      gain_(Eigen::VectorXd::Zero(time_s.size())),
      scale_(Eigen::VectorXd::Zero(time_s.size())) {
  for (const Block& block : blocks) {
    double variance = shape.ratio;  // of the wandering part, before the row is seen
    for (Eigen::Index row = block.begin; row < block.end; ++row) {
      if (row > block.begin) {
        keep_[row] = std::exp(-(time_s[row] - time_s[row - 1]) / shape.tau_s);
        variance = shape.ratio + keep_[row] * keep_[row] * (variance - shape.ratio);
      }
      if (!present[row]) continue;
      const double innovation = variance + 1.0;
      gain_[row] = variance / innovation;
      scale_[row] = 1.0 / std::sqrt(innovation);
      log_determinant_ += std::log(innovation);
      variance *= 1.0 - gain_[row];
    }
  }
}

Eigen::VectorXd Whitener::apply(const Eigen::Ref<const Eigen::VectorXd>& column) const {
  Eigen::VectorXd white(column.size());
  double state = 0.0;
  for (Eigen::Index row = 0; row < column.size(); ++row) {
    state *= keep_[row];
    const double innovation = column[row] - state;
    white[row] = innovation * scale_[row];
    state += gain_[row] * innovation;
  }
  return white;
}

Eigen::MatrixXd Whitener::apply_all(const Eigen::Ref<const Eigen::MatrixXd>& columns) const {
  constexpr Eigen::Index lanes = 8;
  using Lanes = Eigen::Array<double, lanes, 1>;
  Eigen::MatrixXd white(columns.rows(), columns.cols());
  if (gain_.isZero(0.0)) {  // no wandering part
    white = scale_.asDiagonal() * columns;
    return white;
  }
  for (Eigen::Index first = 0; first < columns.cols(); first += lanes) {
    const Eigen::Index count = std::min(lanes, columns.cols() - first);
    std::array<const double*, lanes> from{};
    std::array<double*, lanes> to{};
    for (Eigen::Index lane = 0; lane < count; ++lane) {
      from[static_cast<std::size_t>(lane)] =
          columns.data() + (first + lane) * columns.outerStride();
      to[static_cast<std::size_t>(lane)] = white.data() + (first + lane) * white.outerStride();
    }
    Lanes state = Lanes::Zero();
    Lanes value = Lanes::Zero();
    for (Eigen::Index row = 0; row < columns.rows(); ++row) {
      for (Eigen::Index lane = 0; lane < count; ++lane)
        value[lane] = from[static_cast<std::size_t>(lane)][row];
      state *= keep_[row];
      const Lanes innovation = value - state;
      const Lanes scaled = innovation * scale_[row];
      state += gain_[row] * innovation;
      for (Eigen::Index lane = 0; lane < count; ++lane)
        to[static_cast<std::size_t>(lane)][row] = scaled[lane];
    }
  }
  return white;
}

}  // namespace thermocomp::diagnosis
