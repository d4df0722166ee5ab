/// Displacement of each axis: the controller's signals, the reference state, the model, and the
/// decision whether estimates of lost blocks are accurate enough. Spans in its values are valid
/// until the next step.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"
#include "estimator/sensing/neighbours.hpp"
#include "estimator/sensing/sensing.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Signals of the controller; while it is offline, the last ones.
struct Signals {
  bool online{false};    ///< the controller answers and its report is fresh
  bool complete{false};  ///< true if every value that the model or disable_signal needs is known
  std::span<const double> of_model;  ///< shape (signal_columns)
  bool watches_cutting{false};       ///< a cutting_signal is configured
  double cutting{not_a_number};      ///< NaN: unknown or not configured; so are the next two
  double disable{not_a_number};
  double cycle_end{not_a_number};

  /// True only if the signal is known: an unknown one does not count as "not cutting".
  [[nodiscard]] bool surely_not_cutting() const noexcept { return online && cutting < 0.5; }
  [[nodiscard]] bool may_be_cutting() const noexcept {
    return watches_cutting && !surely_not_cutting();
  }
};

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

/// State of zero displacement.
struct ReferenceState {
  std::span<const double> temps_degC;  ///< shape (temperature_columns)
  std::span<const double> signals;     ///< shape (signal_columns)
  bool known{false};                   ///< all temperatures are known
  bool changed{false};                 ///< in this step
};

/// Temperatures: the model file's numbers, else each column's first good value. Signals: zero with
/// such numbers, which mean a machine at rest; a sampled reference defines zero displacement in the
/// present state, so its signals are those of that moment.
///
/// A first good value is provisional for `provisional_time`, or until the column has moved by
/// `provisional_K`, which a value that a module gives until it is ready does not: if a jump of its
/// sensor begins before that and is confirmed, the value was wrong, and the column's reference is
/// taken again. (Waiting for a steady machine instead would leave one that is started warm without
/// compensation.)
class Reference {
 public:
  static constexpr nanoseconds provisional_time = std::chrono::minutes(10);
  static constexpr double provisional_K = 0.5;

  explicit Reference(const ThermalModel& model);

  /// Takes references that are missing and measured now.
  [[nodiscard]] ReferenceState step(nanoseconds now, const Temperatures& temps,
                                    const Signals& signals) noexcept;
  /// Sets displacement to zero in this state. The signals are taken at the next step.
  /// @pre all temperatures are good
  void take(std::span<const double> temps_degC) noexcept;

  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return temps_degC_; }
  [[nodiscard]] std::span<const double> signals() const noexcept { return signals_; }

  /// Before the first step, by name; missing or non-finite values change nothing.
  void restore(const std::map<std::string, double>& temps_degC,
               const std::map<std::string, double>& signals);
  /// After a reload, with plans of plan_names(). New numbers in the model file are deliberate and
  /// replace the reference; otherwise it stays.
  void adopt(const Reference& previous, const std::vector<int>& columns,
             const std::vector<int>& signals) noexcept;
  /// Takes missing references from an estimator with the same model.
  void complete(const Reference& same) noexcept;
  void visit_temperatures(StateArchive& archive) { archive(temps_degC_, sampled_at_); }
  void visit_signals(StateArchive& archive) { archive(signals_); }

 private:
  const std::vector<double> of_model_file_;  ///< one per input, or empty
  const std::vector<std::string> columns_;
  const std::vector<std::string> signal_names_;

  std::vector<double> temps_degC_;
  std::vector<nanoseconds> sampled_at_;  ///< one per column; min(): not provisional
  std::vector<double> signals_;
};

/// Displacement of the machine without any offset.
struct Displacement {
  bool known{false};  ///< computed in this step; else the numbers below are from an earlier one
  bool block_lost{false};
  bool block_estimated{false};  ///< lost, and estimated well enough
  bool not_finite{false};       ///< good inputs gave no finite number
  bool outside{false};
  bool held{false};                 ///< outside, and configured to hold
  double used_share{1.0};           ///< share of the model's displacement in use
  std::span<const double> zero_um;  ///< per output: the model at the reference state
  std::span<const double> axis_um;  ///< one per axis, with the correction learned from probings
};

/// Standard deviation of each axis from the estimated temperatures,
///
///     sd = sqrt(g^T V g),   g: slope of the axis' output, V: covariance of LostBlocks,
///
/// for a node of a travel with the slide there, compared with compensation.offset_sd_um_max.
class Certainty {
 public:
  struct State {
    std::vector<double> offset_sd_um;  ///< one per axis; 0 if all is measured
    bool uncertain{false};
  };

  /// @param axis_output  axis -> output of the model
  Certainty(const EstimatorConfig& config, const ThermalModel& model,
            const std::vector<std::size_t>& axis_output);

  /// @return true if each column is measured, or estimated well enough. Without signals or a
  /// reference, the last result
  [[nodiscard]] bool step(const LostBlocks& lost, const DisplacementModel& model,
                          const ReferenceState& reference, const Signals& signals) noexcept;
  /// Result of step() with a margin, for use before a sensor is excluded.
  [[nodiscard]] bool is_accurate_enough(const LostBlocks& lost, const DisplacementModel& model,
                                        const ReferenceState& reference,
                                        const Signals& signals) noexcept;
  [[nodiscard]] double offset_sd_um(std::size_t axis) const noexcept {
    return state_.offset_sd_um[axis];
  }

  void adopt(const Certainty& previous) noexcept { state_.uncertain = previous.state_.uncertain; }
  void visit_state(StateArchive& archive) {
    auto& [offset_sd_um, uncertain] = state_;
    archive(offset_sd_um, uncertain);
  }

 private:
  void note_rise(const LostBlocks& lost, const ReferenceState& reference) noexcept;
  /// @pre note_rise()
  [[nodiscard]] double sd_um(std::size_t axis, const LostBlocks& lost,
                             const DisplacementModel& model, const Signals& signals) noexcept;

  const double sd_um_max_;
  const std::vector<std::size_t> axis_output_;
  const std::vector<NodePlace> places_;  ///< one per axis

  State state_;
  std::vector<double> rise_K_;          ///< scratch, one per column
  std::vector<double> slope_um_per_K_;  ///< scratch, one per column
  std::vector<double> signals_;         ///< scratch, of the model
};

/// displacement of an axis = share (model now - model at the reference state) + correction,
///
/// share: part of the model used outside its domain (outside_domain = "shrink"), else 1. The
/// correction learned from probings is used in full.
///
/// At a node of a travel the model is evaluated with the slide there; lags follow the real
/// positions.
class Prediction {
 public:
  struct State {
    bool zero_known{false};
    std::vector<double> model_um;  ///< per output
    std::vector<double> zero_um;   ///< per output: the model at the reference state
  };

  /// @param axis_output  axis -> output of the model
  /// @throws InvalidValue when the model's parts do not fit each other
  Prediction(const EstimatorConfig& config, const ThermalModel& model,
             const std::vector<std::size_t>& axis_output);

  /// @param lost      stepped with `temps`
  /// @param learned   stepped here if there is a displacement to correct
  [[nodiscard]] Displacement step(nanoseconds now, const Temperatures& temps,
                                  const ReferenceState& reference, const Signals& signals,
                                  const LostBlocks& lost, Probings& learned) noexcept;
  /// True if the estimates are accurate enough without the suspected sensors.
  [[nodiscard]] bool is_accurate_enough(const LostBlocks& lost, const ReferenceState& reference,
                                        const Signals& signals) noexcept {
    return certainty_.is_accurate_enough(lost, model_, reference, signals);
  }
  /// A new reference: lags restart.
  void restart() noexcept;

  /// Displacement of an output since the reference; NaN before the first.
  [[nodiscard]] double output_um(std::size_t output) const noexcept {
    return state_.model_um[output] - state_.zero_um[output];
  }
  /// Position of a node along its travel.
  [[nodiscard]] const NodePlace& place(std::size_t axis) const noexcept { return places_[axis]; }
  /// Displacement of an axis by the model alone; of a node with the slide there.
  [[nodiscard]] double model_um(std::size_t axis) const noexcept {
    if (!places_[axis].is_node) return output_um(axis_output_[axis]);
    return node_um_[axis] - state_.zero_um[axis_output_[axis]];
  }
  [[nodiscard]] double axis_um(std::size_t axis, const Probings& learned) const noexcept {
    return used_share() * model_um(axis) + learned.correction_um(axis);
  }
  [[nodiscard]] double offset_sd_um(std::size_t axis) const noexcept {
    return certainty_.offset_sd_um(axis);
  }
  /// Claimed error of the model, standard deviation [um]; NaN: none.
  [[nodiscard]] double claimed_sd_um(std::size_t axis) const noexcept {
    return domain_ ? domain_->sd_um(axis_output_[axis]) : not_a_number;
  }
  [[nodiscard]] const std::optional<ModelDomain>& domain() const noexcept { return domain_; }
  [[nodiscard]] double outside_share_24h() const noexcept { return outside_share_.share(); }
  [[nodiscard]] const DisplacementModel& model() const noexcept { return model_; }

  /// Index of the other prediction's term for each of ours.
  [[nodiscard]] std::vector<int> plan_terms(const Prediction& previous) const {
    return model_.plan_terms(previous.model_);
  }
  [[nodiscard]] bool same_domain(const Prediction& previous) const {
    return domain_ && previous.domain_ && domain_->alike(*previous.domain_);
  }
  /// After a reload: lags, domain and certainty continue; displacement is computed anew.
  void adopt(const Prediction& previous, const std::vector<int>& terms, bool domain) noexcept;
  /// After a reload of the same model.
  void adopt_outside_share(const Prediction& previous) noexcept {
    outside_share_ = previous.outside_share_;
  }
  /// Lags and domain of a parallel prediction. @pre made from the same model
  void adopt_model(const Prediction& beside) noexcept;
  void visit_lags(StateArchive& archive) { archive(model_); }
  void visit_domain(StateArchive& archive);
  void visit_state(StateArchive& archive) {
    auto& [zero_known, model_um, zero_um] = state_;
    archive(zero_known, model_um, zero_um);
    if (!curves_.empty()) archive(node_um_);
  }
  void visit_certainty(StateArchive& archive) { archive(certainty_); }

 private:
  void predict(nanoseconds now, const Temperatures& temps, const ReferenceState& reference,
               const Signals& signals) noexcept;
  void evaluate_at_nodes(nanoseconds now, const Temperatures& temps,
                         const ReferenceState& reference, const Signals& signals) noexcept;
  [[nodiscard]] bool outside() const noexcept { return domain_ && domain_->outside(); }
  [[nodiscard]] double used_share() const noexcept {
    return policy_ == OutsidePolicy::shrink && domain_ ? domain_->used_share() : 1.0;
  }

  const OutsidePolicy policy_;
  const std::vector<std::size_t> axis_output_;
  const std::vector<NodePlace> places_;

  DisplacementModel model_;
  DisplacementModel at_reference_;     ///< the same model, evaluated at the reference only
  std::optional<ModelDomain> domain_;  ///< for a model with [made_from]
  OutsideShare outside_share_;
  Certainty certainty_;
  State state_;
  std::vector<double> axis_um_;
  TravelCurves curves_;
  std::optional<DisplacementModel> elsewhere_;  ///< the same model with its slides at the nodes
  std::vector<double> node_um_;                 ///< one per axis: the model at its node
};

}  // namespace thermocomp
