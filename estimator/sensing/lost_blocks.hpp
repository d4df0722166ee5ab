/// Blocks without a good sensor, estimated from the others.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

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
