/// Temperatures expected from their neighbours, by the covariance of the model's inputs: detection
/// of changes that contradict the neighbours, and estimates of blocks without a good sensor.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "estimator/state_archive.hpp"
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
/// with the growth that the model file gives for estimates in other hours than those of the record.
/// The error of a linear expectation is proportional to the motion: the change relative to those of
/// the record is a = max(1, median of |x_j| / sqrt(2 C_jj)).
///
/// A wrong input also shifts the expectation of its neighbours. The wrong one is the input c
/// without which no other remainder is left unexplained:
///
///     y = Q x,   without c:  y_i - Q_ic y_c / Q_cc,   Q_ii - Q_ic^2 / Q_cc;
///
/// or two inputs if one is not enough. None is named if three would be needed, or if another input
/// explains as much: then the machine does something not in the record, or the two cannot be
/// distinguished.
/// Source: conditional distribution of a Gaussian vector by its precision matrix.
class NeighbourCheck {
 public:
  static constexpr std::size_t inputs_min = 3;  ///< two inputs do not show which one is wrong
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

/// Conditional expectation of the lost inputs L given the others O, from the changes since all
/// inputs were last known (the anchor a, renewed when the set L changes):
///
///     x_L = a_L + B (x_O - a_O),   B = -S Q_LO,   S = (Q_LL)^-1,   Q = (C + noise^2 I)^-1
///
/// An estimate starts at the last good value and needs neither mean nor reference. The covariance
/// of its error grows from W = 2 noise^2 on the diagonal at the loss. For lost inputs i, k:
///
///     V_ik(h) = W_ik + S_ik (d_i d_k g(h / drift_time) + s_i s_k sqrt(g_i g_k)),  g = 1 - exp(-h)
///
/// d, s: drift_factor and scatter_factor of the model file; W: includes the drift so far when L
/// changes; g_i: with the time since the loss of input i over scatter_time. When input k returns,
/// the error of its estimate corrects the inputs still lost: x_i += W_ik / V_kk (x_k - estimate of
/// x_k).
/// Source: the conditional distribution of a Gaussian vector by blocks of its precision matrix.
class LostBlocks {
 public:
  /// Without a covariance in the model it passes its input on.
  /// @param settle  time after the first step without estimates, while sensors start up
  LostBlocks(const ThermalModel& model, nanoseconds settle);

  /// @param temps_degC  shape (columns): the blocks' temperatures, the last known where not good
  /// @param good        shape (columns)
  /// Never throws, never allocates; O(lost^2 inputs) when the set of lost inputs changes, else
  /// O(lost x inputs).
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const std::uint8_t> good) noexcept;

  /// Shape (columns): measured, or estimated where lost.
  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return state_.temps_degC; }
  /// True if every column is measured or estimated.
  [[nodiscard]] bool complete() const noexcept { return state_.complete; }
  [[nodiscard]] std::size_t lost_count() const noexcept { return state_.lost_count; }
  [[nodiscard]] bool estimated(std::size_t column) const noexcept;
  /// Standard deviation of the input's temperature [K]; 0 where it is measured.
  [[nodiscard]] double sd_K(std::size_t column) const noexcept;
  /// Standard deviation of gain . x, with gain of shape (columns). Unit of gain times K.
  [[nodiscard]] double sd_of(std::span<const double> gain_per_K) const noexcept;

  /// Before the step in which a measured input is excluded: the value to continue from instead of
  /// its last one. Ignored for a lost input.
  void continue_from(std::size_t input, double temp_degC, double sd_K) noexcept;

  /// Before the first step: temperature at the end of the previous run, an unknown time ago.
  void restore(std::size_t column, double temp_degC) noexcept;

  void visit_state(StateArchive& archive) { archive(state_); }
  void plan_adoption(const LostBlocks& previous);
  void adopt(const LostBlocks& previous) noexcept;

 private:
  struct State {
    bool started{false};
    bool begun{false};
    nanoseconds start{};
    nanoseconds now{};
    nanoseconds anchored_at{};
    std::vector<double> anchor_degC;
    std::vector<double> temps_degC;
    std::vector<std::uint8_t> lost;      ///< one per input
    std::vector<std::uint8_t> known;     ///< has had a value or an estimate
    std::vector<std::uint8_t> restored;  ///< ... from the previous run only
    std::vector<nanoseconds> lost_since;
    std::vector<std::size_t> lost_at;  ///< the lost inputs, the first lost_count of them
    std::size_t lost_count{0};
    bool complete{false};
    // Shape (inputs, inputs), used in the rows and columns of lost inputs only.
    std::vector<double> gain;       ///< B; row: lost input, column: observed input
    std::vector<double> spread_K2;  ///< S
    std::vector<double> drift_K2;   ///< W
    std::vector<double> error_K2;   ///< V, of this step
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r);
    }
  };
  [[nodiscard]] std::size_t at(std::size_t row, std::size_t column) const noexcept {
    return row * inputs_ + column;
  }
  void begin(std::span<const double> temps_degC, std::span<const std::uint8_t> good) noexcept;
  void take_back(std::size_t input, double temp_degC) noexcept;
  void change_pattern(nanoseconds now, std::span<const double> temps_degC,
                      std::span<const std::uint8_t> good) noexcept;
  void list_lost() noexcept;
  void condition() noexcept;
  void grow(nanoseconds now) noexcept;

  std::vector<std::string> columns_;
  std::size_t inputs_{0};  ///< 0: no covariance
  CovarianceGrowth growth_;
  nanoseconds settle_;
  std::vector<double> precision_per_K2_;  ///< Q, shape (inputs, inputs)

  State state_;

  std::vector<double> given_K2_;  ///< from continue_from(), for the same step
  std::vector<double> factor_;    ///< scratch: Cholesky factor of Q_LL, then its inverse
  std::vector<int> column_plan_;  ///< index in the previous one, -1: none
  std::vector<int> input_plan_;
};

}  // namespace thermocomp
