/// Detection of temperatures whose change contradicts their neighbours, and the precision matrix of
/// the model's inputs.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// (C + noise^2 I)^-1 of the model's covariance, row by row; allocates.
/// @throws InvalidValue when the matrix or the growth of its errors does not fit the model
[[nodiscard]] std::vector<double> precision_per_K2(const ThermalModel& model);

/// 1 - exp(-age / time); for time 0 the step to 1.
[[nodiscard]] double grown(double age_s, double time_s) noexcept;

[[nodiscard]] double drift_factor(const CovarianceGrowth& growth, std::size_t input) noexcept;
[[nodiscard]] double scatter_factor(const CovarianceGrowth& growth, std::size_t input) noexcept;

/// Age of a change and limits of its check.
struct ChangeAsked {
  double age_s{0.0};     ///< between its two moments
  double share{1.0};     ///< variance relative to that of a plain difference of this age
  double sd_limit{1e9};  ///< remainders beyond this many standard deviations are unexplained
};

/// Remainder of input i after its expectation from the others, for the changes x of all inputs and
/// the precision matrix Q of the model's covariance, and its standard deviation:
///
///     r_i = (Q x)_i / Q_ii,
///     sd_i^2 = share a^2 (2 noise^2 + (d_i^2 g(age / drift_time) + s_i^2 g(age / scatter_time)) /
///              Q_ii) + floor^2,       g(h) = 1 - exp(-h),
///
/// with the growth that the model file gives for estimates in hours that it was not made from. The
/// error of a linear expectation is proportional to the motion: the change relative to those of the
/// record is a = max(1, median of |x_j| / sqrt(2 C_jj)).
///
/// A wrong input also shifts the expectation of its neighbours. The wrong one is the input c
/// without which no other remainder is left unexplained:
///
///     y = Q x,   without c:  y_i - Q_ic y_c / Q_cc,   Q_ii - Q_ic^2 / Q_cc;
///
/// or two inputs if one is not enough. None is named if three would be needed, or if another input
/// explains as much: then the machine does what the record never showed, or the two cannot be
/// distinguished.
/// Source: conditional distribution of a Gaussian vector by its precision matrix.
class NeighbourCheck {
 public:
  static constexpr std::size_t inputs_min = 3;  ///< the wrong one of two inputs cannot be found
  static constexpr std::size_t wrong_max = 2;

  struct Wrong {
    std::size_t input{0};
    double size_K{0.0};  ///< unexplained part of its change
    double sd_K{0.0};
  };
  struct Answer {
    std::size_t count{0};
    std::array<Wrong, wrong_max> wrong{};
  };

  /// @throws InvalidValue when covariance and model do not fit each other; allocates
  explicit NeighbourCheck(const ThermalModel& model);

  /// @param change_K  shape (inputs); NaN: not known
  /// Never throws, never allocates; O(inputs^2 (1 + unknown inputs)).
  [[nodiscard]] Answer find(std::span<const double> change_K, const ChangeAsked& asked) noexcept;
  /// r of one input. NaN: its change or those of all others are unknown.
  [[nodiscard]] double remainder_K(std::size_t input, std::span<const double> change_K) noexcept;

 private:
  [[nodiscard]] std::size_t at(std::size_t row, std::size_t column) const noexcept {
    return row * inputs_ + column;
  }
  void prepare(std::span<const double> change_K) noexcept;
  void leave_out(std::size_t input) noexcept;
  [[nodiscard]] double motion() noexcept;
  [[nodiscard]] double variance_K2(std::size_t input, double precision) const noexcept;
  /// Standardised remainder of a present input; 0 without precision.
  [[nodiscard]] double score(double y, double precision, std::size_t input) const noexcept;
  struct Choice {
    bool found{false};
    bool only{true};  ///< no other input explains as much
    std::size_t input{0};
    double rest{0.0};  ///< largest score without it
  };
  [[nodiscard]] double rest_without(std::size_t candidate) const noexcept;
  [[nodiscard]] Choice choose() const noexcept;

  const std::size_t inputs_;
  const CovarianceGrowth growth_;
  const std::vector<double> precision_per_K2_;
  std::vector<double> change_sd_K_;  ///< sqrt(2 C_jj)

  // Scratch of one call.
  ChangeAsked asked_;
  double amplified_{1.0};  ///< a^2
  std::size_t present_count_{0};
  std::vector<std::uint8_t> present_;
  std::vector<double> change_K_;
  std::vector<double> left_;  ///< precision of the present inputs, shape (inputs, inputs)
  std::vector<double> y_;
  std::vector<double> motions_;
};

}  // namespace thermocomp
