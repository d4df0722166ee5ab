/// The state that displacement is counted from: when the machine was straight.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Temperatures: the model file's numbers, else each column's first good value. Signals: zero
/// beside such numbers, which mean a machine at rest; a sampled reference says that the machine is
/// straight as it is, whatever it is doing, so the signals of that moment belong to it.
///
/// A first good value is provisional for `young`: a jump of its sensor that begins in that time and
/// proves true shows that the value was false; then the column's reference is taken anew. (To wait
/// until the machine is steady instead would leave one that is started warm without compensation.)
class Reference {
 public:
  static constexpr nanoseconds young = std::chrono::minutes(10);

  explicit Reference(const ThermalModel& model);

  /// Takes what is not known yet, where it is measured now.
  [[nodiscard]] ReferenceState step(nanoseconds now, const Temperatures& temps,
                                    const Signals& signals) noexcept;
  /// The machine is straight now. The signals are taken at the next step.
  /// @pre all of them are good
  void take(std::span<const double> temps_degC) noexcept;

  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return temps_degC_; }
  [[nodiscard]] std::span<const double> signals() const noexcept { return signals_; }

  /// Before the first step, by name; what is not there or no finite number stays as it is.
  void restore(const std::map<std::string, double>& temps_degC,
               const std::map<std::string, double>& signals);
  /// After a reload with plans of plan_names(). Numbers newly written into the model file are
  /// deliberate; otherwise the machine's state stays.
  void adopt(const Reference& previous, const std::vector<int>& columns,
             const std::vector<int>& signals) noexcept;
  void visit_temperatures(StateArchive& archive) { archive(temps_degC_, sampled_at_); }
  void visit_signals(StateArchive& archive) { archive(signals_); }

 private:
  const std::vector<double> of_model_file_;  ///< one per input, or empty
  const std::vector<std::string> columns_;
  const std::vector<std::string> signal_names_;

  std::vector<double> temps_degC_;
  std::vector<nanoseconds> sampled_at_;  ///< one per column; the least time: not a first value
  std::vector<double> signals_;
};

}  // namespace thermocomp
