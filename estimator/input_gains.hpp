/// How much the model's outputs move with each of its temperatures, for the spread of an offset.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// The derivative of DisplacementModel to its temperatures at the present positions and rises:
/// matrix, guideway rows and the terms that stand on a temperature. Where a term answers late, the
/// larger of what it does at once and what it does in the end.
class InputGains {
 public:
  /// @pre `model` has passed DisplacementModel
  explicit InputGains(const ThermalModel& model);

  /// @param rise_K   shape (temperature_columns)
  /// @param signals  shape (signal_columns)
  /// @param gain_um_per_K  shape (temperature_columns); overwritten
  /// Never throws, never allocates; O(columns + terms).
  void of_output(std::size_t output, std::span<const double> rise_K,
                 std::span<const double> signals, std::span<double> gain_um_per_K) const noexcept;

 private:
  enum class Form { constant, late, squared, position, swap };
  /// A term as far as its temperature goes.
  struct Share {
    Form form;
    std::size_t column;
    std::size_t second;         ///< position: signal; swap: the other column
    double p0_mm;               ///< position
    std::vector<double> gains;  ///< one an output
  };
  /// A temperature of a bank: what its rise has done once each of its lags in turn is over.
  struct BankShare {
    std::size_t column;
    std::vector<std::vector<double>> reached;  ///< shape (outputs, time constants)
  };
  struct Rows {
    std::size_t signal;
    std::vector<double> positions_mm;
    std::vector<std::vector<std::vector<double>>> um_per_K;  ///< output -> position -> input
  };
  void add_term(const ThermalModel& model, const TermSpec& term);
  void add_bank(const ThermalModel& model, const LagBankSpec& bank);

  std::size_t columns_;
  std::vector<std::vector<double>> matrix_um_per_K_;
  std::vector<Rows> guideways_;
  std::vector<Share> shares_;
  std::vector<BankShare> banks_;
};

}  // namespace thermocomp
