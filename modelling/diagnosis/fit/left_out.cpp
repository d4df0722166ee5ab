#include "modelling/diagnosis/fit/left_out.hpp"

#include <algorithm>
#include <utility>

namespace thermocomp::diagnosis {
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
