/// The stages of a step.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/axes/axis_bank.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/learning/cycle_update.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/pipeline/mode.hpp"
#include "estimator/pipeline/prediction.hpp"
#include "estimator/pipeline/signal_intake.hpp"
#include "estimator/sensing/sensing.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Times and results of the last step.
struct StepRecord {
  std::uint64_t cycle{0};
  bool stepped{false};
  nanoseconds now{};
  double dt_s{0.0};
  bool displacement_known{false};
  std::uint32_t reasons{0};
};

/// Index of each of our items in the previous one for a reload, or -1.
struct AdoptionPlan {
  std::vector<int> columns;
  std::vector<int> signals;
  std::vector<int> axes;
  std::vector<int> terms;
  bool same_domain{false};
};

/// In the order of a step; each stage uses only its arguments.
struct Stages {
  /// @throws InvalidValue when configuration and model do not fit each other
  Stages(const EstimatorConfig& estimator_config, const ThermalModel& thermal_model);

  void step(nanoseconds now, std::span<const Reading> readings, const ControllerState& controller,
            OffsetCommand& command) noexcept;

  void plan_adoption(const Stages& previous);
  void adopt(const Stages& previous) noexcept;
  void visit_state(StateArchive& archive);

  const EstimatorConfig config;
  const ThermalModel model;  ///< in axis units: a diameter is its axis' displacement
  const std::vector<std::size_t> axis_output;  ///< axis -> output of the model

  SignalIntake signals;
  Sensing sensing;
  Reference reference;
  Probings learned;
  Prediction prediction;
  ModeDecision mode;
  CycleUpdate cycle_update;
  TargetRule targets;
  AxisBank axes;
  StepRecord record;
  AdoptionPlan plan;
};

}  // namespace thermocomp
