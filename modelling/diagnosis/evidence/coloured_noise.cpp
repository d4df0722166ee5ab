#include "modelling/diagnosis/evidence/coloured_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

/// Factors of each row: m is the state after the row before, x the row's value.
///   white = scale x - dropped m, m = carried m + gain x
struct Factors {
  const double* carried{nullptr};
  const double* gain{nullptr};
  const double* scale{nullptr};
  const double* dropped{nullptr};
  Eigen::Index rows{0};
};

/// Neighbouring columns, whose recursions run side by side.
/// @param to  null: the whitened values are not wanted
/// @param squares  of the whitened values
/// @param plain  of the values as they are
template <std::size_t lanes>
[[gnu::always_inline]] inline void whiten_lanes(const Factors& of, Eigen::Index columns,
                                                const double* from, double* to, double* squares,
                                                double* plain) {
  std::array<double, lanes> state{};
  std::array<double, lanes> sum{};
  std::array<double, lanes> plain_sum{};
  for (Eigen::Index row = 0; row < of.rows; ++row, from += columns) {
    const double carried = of.carried[row];
    const double gain = of.gain[row];
    const double scale = of.scale[row];
    const double dropped = of.dropped[row];
    std::array<double, lanes> white{};
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      white[lane] = scale * from[lane] - dropped * state[lane];
      state[lane] = carried * state[lane] + gain * from[lane];
      sum[lane] += white[lane] * white[lane];
      plain_sum[lane] += from[lane] * from[lane];
    }
    if (to == nullptr) continue;
    for (std::size_t lane = 0; lane < lanes; ++lane) to[lane] = white[lane];
    to += columns;
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    squares[lane] = sum[lane];
    plain[lane] = plain_sum[lane];
  }
}

THERMOCOMP_VECTORISED void whiten(const Factors& of, Eigen::Index columns, const double* from,
                                  double* to, double* squares, double* plain) {
  side_by_side<16>(
      columns, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        whiten_lanes<lanes()>(of, columns, from + at, to == nullptr ? nullptr : to + at,
                              squares + at, plain + at);
      });
}

}  // namespace

Whitener::Whitener(const NoiseShape& shape, const Eigen::VectorXd& time_s,
                   const std::vector<Block>& blocks,
                   const Eigen::Array<bool, Eigen::Dynamic, 1>& present)
    : wanders_(shape.ratio > 0),
      keep_(Eigen::VectorXd::Zero(time_s.size())),
      gain_(Eigen::VectorXd::Zero(time_s.size())),
      scale_(Eigen::VectorXd::Zero(time_s.size())),
      carried_(time_s.size()),
      dropped_(time_s.size()) {
  for (const Block& block : blocks) {
    double variance = shape.ratio;  // of the wandering part, before the row is seen
    double step_s = 0.0;
    double keep = 1.0;
    double innovation = 0.0;
    double log_innovation = 0.0;
    for (Eigen::Index row = block.begin; row < block.end; ++row) {
      if (row > block.begin) {
        // Rows are mostly as far from each other as those before them, and the innovation's spread
        // comes to rest.
        if (time_s[row] - time_s[row - 1] != step_s) {
          step_s = time_s[row] - time_s[row - 1];
          keep = std::exp(-step_s / shape.tau_s);
        }
        keep_[row] = keep;
        variance = shape.ratio + keep * keep * (variance - shape.ratio);
      }
      if (!present[row]) continue;
      if (variance + 1.0 != innovation) {
        innovation = variance + 1.0;
        log_innovation = std::log(innovation);
      }
      gain_[row] = variance / innovation;
      scale_[row] = 1.0 / std::sqrt(innovation);
      log_determinant_ += log_innovation;
      variance *= 1.0 - gain_[row];
    }
  }
  carried_ = keep_.array() * (1.0 - gain_.array());
  dropped_ = keep_.array() * scale_.array();
}

Eigen::VectorXd Whitener::apply(const Eigen::VectorXd& column) const {
  return apply(Panel(column));
}

Panel Whitener::apply(const Panel& columns) const {
  if (!wanders_) return scale_.asDiagonal() * columns;
  Eigen::MatrixXd squares;
  return apply(columns, squares);
}

Panel Whitener::apply(const Panel& columns, Eigen::MatrixXd& squares) const {
  Panel white(columns.rows(), columns.cols());
  squares.resize(1, columns.cols());
  Eigen::VectorXd plain(columns.cols());
  whiten({carried_.data(), gain_.data(), scale_.data(), dropped_.data(), scale_.size()},
         columns.cols(), columns.data(), white.data(), squares.data(), plain.data());
  return white;
}

Whitener::Squares Whitener::squares(const Panel& columns) const {
  Squares of{Eigen::MatrixXd(1, columns.cols()), Eigen::MatrixXd(1, columns.cols())};
  whiten({carried_.data(), gain_.data(), scale_.data(), dropped_.data(), scale_.size()},
         columns.cols(), columns.data(), nullptr, of.white.data(), of.plain.data());
  return of;
}

// apply() with p the state that was predicted, m the state after the row, e the innovation:
//   p = keep m_before, e = x - p, m = p + gain e, white = scale e.
// Transposed: from the last row back, with `later` the weight of m in the rows after it.
Panel Whitener::transposed(const Panel& white) const {
  if (changes_nothing()) return white;
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
