#include "modelling/diagnosis/rank/output_fit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/runs/robust.hpp"

namespace thermocomp::diagnosis {

Panel centred_in(const std::vector<Block>& runs, Panel columns) {
  for (const Block& run : runs) {
    auto part = columns.middleRows(run.begin, run.end - run.begin);
    if (part.rows() > 0) part.rowwise() -= part.colwise().mean().eval();
  }
  return columns;
}

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

namespace {

/// Enough rows for effects of minutes and hours.
constexpr Eigen::Index rows_max = 480;
/// Rows are not averaged over gaps longer than this multiple of an averaged row.
constexpr double gap_factor = 3.0;
/// Model discrepancy: deviation of a physical effect from its form as a share of its RMS. It is 5
/// to 20 % for the bodies, joints and films of tests/diagnosis/physical_effects.py.
constexpr double discrepancy = 0.1;
constexpr double never_known = 1e-9;
constexpr double least_variance = 1e-9;

/// Standard deviation of the white noise from second differences, which contain no offset or slope;
/// 0 if there are none.
double noise_of(const Column& values, const std::vector<Block>& runs) {
  std::vector<double> bends;
  for (const Block& run : runs)
    for (Eigen::Index row = run.begin + 1; row + 1 < run.end; ++row)
      bends.push_back(std::abs(values[row + 1] - 2.0 * values[row] + values[row - 1]));
  return bends.empty() ? 0.0 : median(std::move(bends)) / (0.6745 * std::sqrt(6.0));
}

}  // namespace

double log_mean_exp(const Eigen::VectorXd& values) {
  const double most = values.maxCoeff();
  return std::isfinite(most) ? most + std::log((values.array() - most).exp().mean()) : most;
}

OutputRows::OutputRows(const StackedRows& rows,
                       const Eigen::Array<bool, Eigen::Dynamic, 1>& present) {
  const Eigen::Index apart = std::max<Eigen::Index>(1, (present.count() + rows_max - 1) / rows_max);
  double length_s = 0.0;
  for (const Block& run : rows.runs)
    if (run.end > run.begin) length_s += rows.time_s[run.end - 1] - rows.time_s[run.begin];
  const double longest_s = gap_factor * length_s / static_cast<double>(rows_max);
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<double> times_s;
  for (const Block& run : rows.runs) {
    Block own{std::ssize(times_s), 0};
    std::vector<Eigen::Index> together;
    const auto close = [&] {
      double sum_s = 0.0;
      for (const Eigen::Index row : together) {
        sum_s += rows.time_s[row];
        entries.emplace_back(std::ssize(times_s), row, 1.0 / static_cast<double>(together.size()));
      }
      times_s.push_back(sum_s / static_cast<double>(together.size()));
      together.clear();
    };
    for (Eigen::Index row = run.begin; row < run.end; ++row) {
      if (!together.empty() && rows.time_s[row] - rows.time_s[together.front()] > longest_s)
        close();
      if (present[row]) together.push_back(row);
      if (std::ssize(together) == apart) close();
    }
    if (!together.empty()) close();
    own.end = std::ssize(times_s);
    runs_.push_back(own);
  }
  time_s_ = Eigen::Map<const Column>(times_s.data(), std::ssize(times_s));
  means_.resize(time_s_.size(), rows.time_s.size());
  means_.setFromTriplets(entries.begin(), entries.end());
}

OutputFit::OutputFit(OutputRows rows, Column remainder, const Panel& common,
                     const Eigen::VectorXd& sd, double least_noise)
    : rows_(std::move(rows)),
      remainder_(std::move(remainder)),
      least_noise_(std::max(least_noise, std::sqrt(least_variance))),
      noise_(noise_beside(Column::Zero(remainder_.size()))) {
  Panel both(rows_.size(), 1 + common.cols());
  both << remainder_, common;
  const Eigen::VectorXd precision =
      (noise_ / sd.array())
          .square()
          .max(never_known * common.colwise().squaredNorm().transpose().array() + 1e-12);
  Eigen::VectorXd none(std::ssize(backgrounds()));
  for (const Background& background : backgrounds()) {
    Under under;
    under.white = both;
    under.log_determinant = whiten(background, rows_.time_s(), rows_.runs(), under.white);
    const auto y = under.white.col(0);
    const auto z = under.white.rightCols(common.cols());
    Eigen::MatrixXd square = z.transpose() * z;
    square.diagonal() += precision;
    under.root.compute(square);
    under.common_remainder = under.root.matrixL().solve(z.transpose() * y);
    under.squares = y.squaredNorm() - under.common_remainder.squaredNorm();
    under.log_determinant +=
        2.0 * under.root.matrixLLT().diagonal().array().log().sum() - precision.array().log().sum();
    under_.push_back(std::move(under));
    none[std::ssize(under_) - 1] = log_likelihood(std::ssize(under_) - 1, 0.0, 0.0);
  }
  none_ = log_mean_exp(none);
}

double OutputFit::noise_beside(const Column& effect) const {
  return std::max(noise_of(remainder_ - effect, rows_.runs()), least_noise_);
}

Equations OutputFit::equations(const Panel& columns, Eigen::Index width) const {
  const Eigen::Index shapes = columns.cols() / width;
  const auto count = static_cast<Eigen::Index>(under_.size());
  Equations all{width, Eigen::MatrixXd(columns.cols(), count),
                Eigen::MatrixXd(width * columns.cols(), count),
                Eigen::MatrixXd(width * width, shapes)};
  const auto products_within = [&](const Panel& of, Eigen::Index shape) -> Eigen::MatrixXd {
    const auto group = of.middleCols(width * shape, width);
    return group.transpose() * group;
  };
  const Panel centred = centred_in(rows_.runs(), columns);
  for (Eigen::Index shape = 0; shape < shapes; ++shape)
    all.size.col(shape) =
        products_within(centred, shape).reshaped() / static_cast<double>(rows_.size());
  for (Eigen::Index b = 0; b < count; ++b) {
    const Under& under = under_[static_cast<std::size_t>(b)];
    Panel white = columns;
    whiten(backgrounds()[static_cast<std::size_t>(b)], rows_.time_s(), rows_.runs(), white);
    const Eigen::MatrixXd common = under.root.matrixL().solve(
        under.white.rightCols(under.white.cols() - 1).transpose() * white);
    all.right.col(b) =
        white.transpose() * under.white.col(0) - common.transpose() * under.common_remainder;
    for (Eigen::Index shape = 0; shape < shapes; ++shape) {
      const auto part = common.middleCols(width * shape, width);
      all.square.col(b).segment(width * width * shape, width * width) =
          (products_within(white, shape) - part.transpose() * part).reshaped();
    }
  }
  return all;
}

double OutputFit::variance(Eigen::Index under, double explained) const {
  const double left = under_[static_cast<std::size_t>(under)].squares - explained;
  return std::max(least_variance, left / static_cast<double>(rows_.size()));
}

double OutputFit::log_likelihood(Eigen::Index under, double explained, double effect_square) const {
  const Under& of = under_[static_cast<std::size_t>(under)];
  const auto n = static_cast<double>(rows_.size());
  const double ratio = std::max(1.0, backgrounds()[static_cast<std::size_t>(under)].ratio);
  const double own = variance(under, explained);
  const double held = std::max(own, discrepancy * discrepancy * effect_square / (ratio * ratio));
  return -0.5 * (n * (std::log(held) + own / held) + of.log_determinant);
}

Eigen::VectorXd OutputFit::common_factors() const {
  const auto likelihood = [&](const Under& of) {
    return log_likelihood(&of - under_.data(), 0.0, 0.0);
  };
  const auto best =
      std::max_element(under_.begin(), under_.end(),
                       [&](const auto& a, const auto& b) { return likelihood(a) < likelihood(b); });
  return best->root.matrixU().solve(best->common_remainder);
}

namespace {

constexpr Eigen::Index eighths = 8;
/// Ridge as a share of the products' trace: keeps nearly dependent columns solvable.
constexpr double ridge = 1e-9;

}  // namespace

Eigen::LLT<Eigen::MatrixXd> LeftOut::rooted(Eigen::MatrixXd products) {
  products.diagonal().array() += ridge * products.trace() + 1e-12;
  return Eigen::LLT<Eigen::MatrixXd>(products);
}

LeftOut::LeftOut(Column values, Panel accepted)
    : values_(std::move(values)), accepted_(std::move(accepted)) {
  const Eigen::MatrixXd products = accepted_.transpose() * accepted_;
  const Eigen::VectorXd right = accepted_.transpose() * values_;
  all_ = rooted(products);
  for (Eigen::Index i = 0; i < eighths; ++i) {
    Eighth of;
    of.begin = values_.size() * i / eighths;
    of.count = values_.size() * (i + 1) / eighths - of.begin;
    const auto part = accepted_.middleRows(of.begin, of.count);
    const auto own = values_.segment(of.begin, of.count);
    of.others = rooted(products - part.transpose() * part);
    of.factors = of.others.solve(right - part.transpose() * own);
    before_ += (own - part * of.factors).squaredNorm();
    eighths_.push_back(std::move(of));
  }
}

std::vector<double> LeftOut::after(const Panel& columns, Eigen::Index width,
                                   const Interval& bounds) const {
  const Eigen::Index groups = columns.cols() / width;
  std::vector<double> left(static_cast<std::size_t>(groups), 0.0);
  const Eigen::MatrixXd beside = accepted_.transpose() * columns;
  const Eigen::VectorXd right = columns.transpose() * values_;
  std::vector<Eigen::MatrixXd> squares;
  for (Eigen::Index group = 0; group < groups; ++group) {
    const auto of = columns.middleCols(width * group, width);
    squares.emplace_back(of.transpose() * of);
  }
  for (const Eighth& eighth : eighths_) {
    const auto accepted = accepted_.middleRows(eighth.begin, eighth.count);
    const auto tried = columns.middleRows(eighth.begin, eighth.count);
    const auto own = values_.segment(eighth.begin, eighth.count);
    const Eigen::MatrixXd of_others = beside - accepted.transpose() * tried;
    const Eigen::MatrixXd taken = eighth.others.solve(of_others);
    const Eigen::VectorXd free_right =
        right - tried.transpose() * own - of_others.transpose() * eighth.factors;
    const Column free_values = own - accepted * eighth.factors;
    const Panel free_columns = tried - accepted * taken;
    for (Eigen::Index group = 0; group < groups; ++group) {
      const auto part = tried.middleCols(width * group, width);
      Eigen::MatrixXd square = squares[static_cast<std::size_t>(group)] - part.transpose() * part -
                               of_others.middleCols(width * group, width).transpose() *
                                   taken.middleCols(width * group, width);
      square.diagonal().array() +=
          ridge * squares[static_cast<std::size_t>(group)].trace() + 1e-300;
      Eigen::VectorXd gains = square.ldlt().solve(free_right.segment(width * group, width));
      if (width == 1) gains[0] = std::clamp(gains[0], bounds.low, bounds.high);
      left[static_cast<std::size_t>(group)] +=
          (free_values - free_columns.middleCols(width * group, width) * gains).squaredNorm();
    }
  }
  return left;
}

Panel LeftOut::beside_accepted(const Panel& columns) const {
  return columns - accepted_ * all_.solve(accepted_.transpose() * columns);
}

}  // namespace thermocomp::diagnosis
