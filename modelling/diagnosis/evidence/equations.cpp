#include "modelling/diagnosis/evidence/equations.hpp"

#include <Eigen/Cholesky>

namespace thermocomp::diagnosis {

Eigen::VectorXd EquationsTable::gains(std::size_t group) const {
  if (width_ == 1) {
    const double square_of_one = square(group)(0, 0);
    return Eigen::VectorXd::Constant(1, square_of_one > 0 ? right(group)[0] / square_of_one : 0.0);
  }
  if (width_ == 2)
    return Eigen::Matrix2d(square(group)).ldlt().solve(Eigen::Vector2d(right(group)));
  return Eigen::MatrixXd(square(group)).ldlt().solve(right(group));
}

double EquationsTable::taken(std::size_t group, const Eigen::VectorXd& gains) const {
  return 2.0 * gains.dot(right(group)) - gains.dot(square(group) * gains);
}

void EquationsTable::copy(const EquationsTable& from, std::size_t group, std::size_t to,
                          double times) {
  square(to) = from.square(group) * (times * times);
  right(to) = from.right(group) * times;
}

}  // namespace thermocomp::diagnosis
