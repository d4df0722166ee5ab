/// What displacements measured at the tool teach: a correction per axis, and how far the model was
/// off.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/learning/probed_error.hpp"
#include "estimator/learning/running_correction.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

class Probings {
 public:
  /// @param axis_output  axis -> output of the model
  /// @throws InvalidValue as RunningCorrection
  Probings(const EstimatorConfig& config, const ThermalModel& model,
           const std::vector<std::size_t>& axis_output);

  /// @param may_change  false: what was learned waits for the end of the cut
  void step(nanoseconds now, const Temperatures& temps, const ReferenceState& reference,
            bool may_change) noexcept;
  /// By how much the axis' displacement differs from the model's [um].
  [[nodiscard]] double correction_um(std::size_t axis) const noexcept {
    return corrections_[axis].correction_um();
  }
  /// The same at another state of the machine.
  [[nodiscard]] double correction_um(std::size_t axis,
                                     std::span<const double> rise_K) const noexcept {
    return corrections_[axis].correction_um(rise_K);
  }

  /// A value from an operator or a probe, whether or not anything can be learned from it.
  void note(std::size_t axis, double value_um) noexcept { measured_um_[axis] = value_um; }
  /// @param total_um  measured, as it would be without any offset
  /// @param model_um  the model's at the same moment, without correction
  void learn(std::size_t axis, double total_um, double model_um) noexcept;
  /// A new reference: displacements count from here.
  void restart() noexcept;

  [[nodiscard]] double measured_um(std::size_t axis) const noexcept { return measured_um_[axis]; }
  [[nodiscard]] double rms_um(std::size_t axis) const noexcept { return errors_[axis].rms_um(); }
  [[nodiscard]] CorrectionReport report(std::size_t axis) const noexcept {
    return corrections_[axis].report();
  }

  /// Before the first step; see RunningCorrection::restore().
  void restore(const std::map<std::string, double>& corrections);
  /// @param axes  from plan_names()
  void adopt(const Probings& previous, const std::vector<int>& axes) noexcept;
  void visit_learned(StateArchive& archive);
  void visit_measured(StateArchive& archive) { archive(measured_um_); }

 private:
  const std::vector<std::string> axis_names_;

  std::vector<RunningCorrection> corrections_;  ///< one per axis, as are the next two
  std::vector<ProbedError> errors_;
  std::vector<double> measured_um_;
  std::vector<double> rise_K_;  ///< scratch, one per column
};

}  // namespace thermocomp
