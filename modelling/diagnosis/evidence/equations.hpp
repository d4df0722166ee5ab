/// Normal equations of many groups of columns.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace thermocomp::diagnosis {

/// Of groups of `width` columns each, in one piece of memory.
class EquationsTable {
 public:
  EquationsTable() = default;
  /// All zero.
  EquationsTable(std::size_t groups, Eigen::Index width)
      : width_(width),
        stride_(static_cast<std::size_t>(width * (width + 1))),
        values_(groups * stride_) {}

  [[nodiscard]] Eigen::Index width() const noexcept { return width_; }
  /// Products of the group's columns with each other, shape (width, width).
  [[nodiscard]] Eigen::Map<Eigen::MatrixXd> square(std::size_t group) {
    return {values_.data() + group * stride_, width_, width_};
  }
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> square(std::size_t group) const {
    return {values_.data() + group * stride_, width_, width_};
  }
  /// Products with the residual, shape (width).
  [[nodiscard]] Eigen::Map<Eigen::VectorXd> right(std::size_t group) {
    return {values_.data() + group * stride_ + width_ * width_, width_};
  }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> right(std::size_t group) const {
    return {values_.data() + group * stride_ + width_ * width_, width_};
  }
  /// square^-1 right; 0 where a single column is.
  [[nodiscard]] Eigen::VectorXd gains(std::size_t group) const;
  /// What they take from the residual's sum of squares: 2 gains' right - gains' square gains.
  [[nodiscard]] double taken(std::size_t group, const Eigen::VectorXd& gains) const;
  /// Puts a group of `from` in place of `to`, as it is where every column is `times` as large.
  /// @pre both tables have the same width
  void copy(const EquationsTable& from, std::size_t group, std::size_t to, double times = 1.0);

 private:
  Eigen::Index width_{0};
  std::size_t stride_{0};
  std::vector<double> values_;
};

}  // namespace thermocomp::diagnosis
