#include "modelling/diagnosis/coloured_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

/// Neighbouring columns, whose recursions run side by side.
template <std::size_t lanes>
[[gnu::always_inline]] inline void whiten_lanes(const Eigen::VectorXd& keep,
                                                const Eigen::VectorXd& gain,
                                                const Eigen::VectorXd& scale, Eigen::Index columns,
                                                const double* from, double* to) {
  std::array<double, lanes> state{};
  for (Eigen::Index row = 0; row < keep.size(); ++row, from += columns, to += columns) {
    const double keep_now = keep[row];
    const double gain_now = gain[row];
    const double scale_now = scale[row];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const double predicted = state[lane] * keep_now;
      const double innovation = from[lane] - predicted;
      to[lane] = innovation * scale_now;
      state[lane] = predicted + gain_now * innovation;
    }
  }
}

THERMOCOMP_VECTORISED void whiten(const Eigen::VectorXd& keep, const Eigen::VectorXd& gain,
                                  const Eigen::VectorXd& scale, Eigen::Index columns,
                                  const double* from, double* to) {
  Eigen::Index at = 0;
  for (; at + 16 <= columns; at += 16)
    whiten_lanes<16>(keep, gain, scale, columns, from + at, to + at);
  for (; at + 8 <= columns; at += 8)
    whiten_lanes<8>(keep, gain, scale, columns, from + at, to + at);
  for (; at + 4 <= columns; at += 4)
    whiten_lanes<4>(keep, gain, scale, columns, from + at, to + at);
  for (; at + 2 <= columns; at += 2)
    whiten_lanes<2>(keep, gain, scale, columns, from + at, to + at);
  for (; at < columns; ++at) whiten_lanes<1>(keep, gain, scale, columns, from + at, to + at);
}

}  // namespace

Whitener::Whitener(const NoiseShape& shape, const Eigen::VectorXd& time_s,
                   const std::vector<Block>& blocks,
                   const Eigen::Array<bool, Eigen::Dynamic, 1>& present)
    : wanders_(shape.ratio > 0),
      keep_(Eigen::VectorXd::Zero(time_s.size())),
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

Eigen::VectorXd Whitener::apply(const Eigen::VectorXd& column) const {
  Eigen::VectorXd white(column.size());
  whiten(keep_, gain_, scale_, 1, column.data(), white.data());
  return white;
}

Panel Whitener::apply(const Panel& columns) const {
  Panel white(columns.rows(), columns.cols());
  if (wanders_)
    whiten(keep_, gain_, scale_, columns.cols(), columns.data(), white.data());
  else
    white = scale_.asDiagonal() * columns;
  return white;
}

// apply() with p the state that was predicted, m the state after the row, e the innovation:
//   p = keep m_before, e = x - p, m = p + gain e, white = scale e.
// Transposed: from the last row back, with `later` the weight of m in the rows after it.
Panel Whitener::transposed(const Panel& white) const {
  Panel out(white.rows(), white.cols());
  Eigen::RowVectorXd later = Eigen::RowVectorXd::Zero(white.cols());
  for (Eigen::Index row = white.rows() - 1; row >= 0; --row) {
    out.row(row) = scale_[row] * white.row(row) + gain_[row] * later;
    later = keep_[row] * (later - out.row(row));
  }
  return out;
}

// With `rest` the sum of squares that a unit of m leaves in the rows after it, a unit of x in a row
// leaves scale^2 + gain^2 rest, and units of x in two rows leave a product that is a factor of the
// earlier row times one of the later, both carried along by keep (1 - gain).
Eigen::MatrixXd Whitener::squares_from_rows(const Panel& whole,
                                            const std::vector<Eigen::Index>& first_rows) const {
  Eigen::MatrixXd squares(std::ssize(first_rows), whole.cols());
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(whole.cols());
  Eigen::RowVectorXd later = Eigen::RowVectorXd::Zero(whole.cols());
  double rest = 0.0;
  Eigen::Index row = whole.rows();
  for (std::size_t i = first_rows.size(); i-- > 0;) {
    while (row > first_rows[i]) {
      --row;
      const double scale = scale_[row] * scale_[row];
      const double gain = gain_[row];
      const double of_later = (1.0 - gain) * gain * rest - scale;
      sum.array() += whole.row(row).array() *
                     ((scale + gain * gain * rest) * whole.row(row) + 2.0 * gain * later).array();
      later = keep_[row] * (of_later * whole.row(row) + (1.0 - gain) * later);
      rest = keep_[row] * keep_[row] * (scale + (1.0 - gain) * (1.0 - gain) * rest);
    }
    squares.row(static_cast<Eigen::Index>(i)) = sum;
  }
  return squares;
}

}  // namespace thermocomp::diagnosis
