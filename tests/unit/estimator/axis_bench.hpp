/// One axis as driven by the daemon, with its controller.
#pragma once

#include "estimator/axes/axis_bank.hpp"

namespace thermocomp::test {

inline AxisConfig axis_of(double offset_um_max = 50, double rate_um_per_s_max = 2) {
  return {"z", "z_um", 1.0, {offset_um_max, rate_um_per_s_max}};
}

/// Stepped every 0.1 s.
struct Bench {
  explicit Bench(bool reads_back = true, const AxisConfig& axis = axis_of(),
                 const CompensationConfig& compensation = {})
      : bank(config_of(reads_back, axis, compensation)) {
    input.dt_s = 0.1;
    input.link_epoch = 1;
    input.online = true;
    input.written = true;
    input.applied_um = 0.0;
  }
  /// The controller applies the offset of the previous step.
  void step(double target_um) {
    if (obeys && axis().driven()) input.applied_um = axis().offset_um();
    input.now += std::chrono::milliseconds(100);
    input.taken_at = input.now;
    input.target_um = target_um;
    read_back();
  }
  void steps(int count, double target_um) {
    for (int i = 0; i < count; ++i) step(target_um);
  }
  /// One step with the present input.
  void read_back() {
    Targets targets;
    targets.axis_um = {&input.target_um, 1};
    targets.may_change = input.may_change;
    ControllerState controller;
    controller.link_epoch = input.link_epoch;
    controller.written = input.written;
    controller.applied_um[0] = input.applied_um;
    controller.taken_at = input.taken_at;
    OffsetCommand command;
    bank.step({input.now, input.dt_s}, targets, input.online, controller, command);
  }
  void release() { bank.release(0); }
  void prove(double move_um) { bank.prove(0, move_um); }
  [[nodiscard]] const AxisChannel& axis() const { return bank[0]; }

  AxisInput input;
  AxisBank bank;
  bool obeys{true};

 private:
  static EstimatorConfig config_of(bool reads_back, const AxisConfig& axis,
                                   const CompensationConfig& compensation) {
    EstimatorConfig config;
    config.axes = {axis};
    config.compensation = compensation;
    config.controller_reads_back = reads_back;
    return config;
  }
};

}  // namespace thermocomp::test
