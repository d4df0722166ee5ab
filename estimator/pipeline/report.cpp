#include "estimator/pipeline/report.hpp"

#include <chrono>

#include "estimator/pipeline/stages.hpp"

namespace thermocomp {
namespace {

void report_axis(const Stages& stages, std::size_t axis, AxisReport& out) noexcept {
  const AxisChannel& channel = stages.axes[axis];
  out.displacement_um = stages.prediction.axis_um(axis, stages.learned);
  out.target_um = channel.target_um();
  out.offset_um = channel.offset_um();
  out.applied_um = channel.applied_um();
  out.measured_um = stages.learned.measured_um(axis);
  out.synced = channel.synced();
  out.driven = stages.axes.driven(axis);
  out.disagrees = channel.mismatch();
  out.start = channel.start();
  out.start_unknown = channel.start_unknown();
  out.waits_for_disk = channel.waits_for_disk();
  out.corridor_um = channel.corridor_um();
  out.latched = channel.latched();
  out.releasing = channel.releasing();
  out.latched_mismatch = channel.latched_mismatch();
  out.at_bound = channel.at_bound();
  out.proving = channel.proving();
  out.offset_sd_um = stages.prediction.offset_sd_um(axis);
  out.held_um = stages.cycle_update.held_um(axis);
  out.claimed_sd_um = stages.prediction.claimed_sd_um(axis);
  out.probed_rms_um = stages.learned.rms_um(axis);
  out.probings = stages.learned.count(axis);
  out.entered_um = stages.learned.operator_um(axis).entered_um;
  out.absorbed_um = stages.learned.operator_um(axis).learned_um;
  out.correction = stages.learned.report(axis);
}

DomainReport domain_of(const Prediction& prediction) noexcept {
  DomainReport report;
  report.outside_share_24h = prediction.outside_share_24h();
  if (!prediction.domain()) return report;
  report.known = true;
  report.outside = prediction.domain()->outside();
  report.distance = prediction.domain()->distance();
  return report;
}

}  // namespace

Report sized_report(const Stages& stages) {
  Report out;
  out.sensors.resize(stages.config.sensors.size());
  out.inputs.resize(stages.reference.temps_degC().size());
  out.signals.resize(stages.signals.of_model().size());
  out.displacement_um.resize(stages.model.outputs.size());
  out.axes.resize(stages.axes.size());
  return out;
}

void fill_report(const Stages& stages, Report& out) noexcept {
  const ModeDecision::State& mode = stages.mode.state();
  const CycleHold& held = stages.cycle_update.hold();
  out.cycle = stages.record.cycle;
  out.now = stages.record.now;
  out.mode = mode.mode;
  out.mode_since = mode.mode_since;
  out.reasons = stages.record.reasons;
  out.enabled = mode.enabled;
  out.cycle_ends = stages.cycle_update.cycle_ends();
  out.remembered_s = std::chrono::duration<double>(stages.learned.remembered()).count();
  stages.sensing.report(out.sensors);
  const LostBlocks& lost = stages.sensing.lost();
  for (std::size_t i = 0; i < out.inputs.size(); ++i)
    out.inputs[i] = {lost.temps_degC()[i],
                     stages.reference.temps_degC()[i],
                     stages.sensing.blocks().good(i),
                     lost.estimated(i),
                     lost.sd_K(i),
                     held.temps_degC()[i]};
  for (std::size_t i = 0; i < out.signals.size(); ++i)
    out.signals[i] = {stages.signals.of_model()[i], stages.reference.signals()[i], held.signal(i)};
  for (std::size_t i = 0; i < out.displacement_um.size(); ++i)
    out.displacement_um[i] = stages.prediction.output_um(i);
  for (std::size_t i = 0; i < out.axes.size(); ++i) report_axis(stages, i, out.axes[i]);
  out.domain = domain_of(stages.prediction);
}

}  // namespace thermocomp
