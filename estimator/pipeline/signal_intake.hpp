/// Signals of a step, from the controller's state.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// A controller that is offline, or whose values are older than controller_stale_after_s, gives no
/// signals: its positions and switches have no effect, and the offset holds where they are needed.
class SignalIntake {
 public:
  struct State {
    std::array<double, signals_max> last{};  ///< order of the configuration
    bool online{false};
  };

  /// @throws InvalidValue when the model or a rule needs a signal that is not configured
  SignalIntake(const EstimatorConfig& config, const ThermalModel& model);

  [[nodiscard]] Signals step(nanoseconds now, const ControllerState& controller) noexcept;
  /// The model's signals, as last reported.
  [[nodiscard]] std::span<const double> of_model() const noexcept { return of_model_; }

  /// @param plan  from plan_names() for the model's signals
  void adopt(const SignalIntake& previous, const std::vector<int>& plan) noexcept;
  void visit_last(StateArchive& archive) {
    auto& [last, online] = state_;
    archive(last, online);
  }
  void visit_of_model(StateArchive& archive) { archive(of_model_); }

 private:
  [[nodiscard]] bool take(const ControllerState& controller) noexcept;
  [[nodiscard]] double last_value(std::optional<std::size_t> signal) const noexcept {
    return signal ? state_.last[*signal] : not_a_number;
  }

  const std::vector<std::string> names_;
  const std::vector<std::size_t> model_signals_;  ///< model's signal -> configured signal
  const std::optional<std::size_t> cutting_;
  const std::optional<std::size_t> disable_;
  const std::optional<std::size_t> cycle_end_;
  const nanoseconds stale_after_;

  State state_;
  std::vector<double> of_model_;
};

}  // namespace thermocomp
