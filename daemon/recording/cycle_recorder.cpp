#include "daemon/recording/cycle_recorder.hpp"

#include <algorithm>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

std::uint64_t cycles_in(nanoseconds duration, nanoseconds period) {
  const std::int64_t cycles = (duration + period / 2) / period;
  return static_cast<std::uint64_t>(std::max<std::int64_t>(1, cycles));
}

/// The next multiple of `every` after `cycle`; keeps the phase when cycles are skipped.
std::uint64_t next_multiple(std::uint64_t cycle, std::uint64_t every) noexcept {
  return cycle - cycle % every + every;
}

bool same(const Reading& a, const Reading& b) noexcept {
  return same_bits(a.temp_degC, b.temp_degC) && a.taken_at == b.taken_at && a.fault == b.fault;
}

}  // namespace

CycleRecorder::CycleRecorder(RecordRing& ring, std::shared_ptr<RecordingSession> session,
                             const Grid& grid, nanoseconds offsets_period,
                             const Estimator& estimator)
    : ring_(ring),
      session_(std::move(session)),
      offsets_every_(cycles_in(offsets_period, grid.period)),
      done_every_(cycles_in(std::chrono::seconds(1), grid.period)),
      axes_(static_cast<std::uint32_t>(estimator.config().axes.size())),
      readings_(estimator.config().sensors.size()) {
  for (Snapshot& snapshot : session_->snapshots) {
    snapshot.estimator_state.resize(estimator.state_size_bytes());
    snapshot.readings = readings_;
  }
}

void CycleRecorder::begin(std::uint64_t first_cycle, const Estimator& estimator,
                          SegmentReason reason, const CycleRecorder* previous) noexcept {
  last_whole_cycle_ = previous != nullptr ? previous->last_whole_cycle_ : -1;
  broken_ = true;
  broken_reason_ = previous != nullptr && previous->broken_ ? SegmentReason::gap : reason;
  snapshot(first_cycle, estimator, broken_reason_);
}

void CycleRecorder::command(std::uint64_t cycle, const Command& command) noexcept {
  Record record;
  record.cycle = cycle;
  record.value = command.value_um;
  record.index = command.axis;
  record.time_ns = measured_bits(command);
  record.kind = RecordKind::command;
  record.detail = static_cast<std::uint8_t>(command.kind);
  push(record);
}

void CycleRecorder::skipped(std::uint64_t from, std::uint64_t to) noexcept {
  Record record;
  record.cycle = from;
  record.time_ns = static_cast<std::int64_t>(to);
  record.kind = RecordKind::skipped;
  push(record);
}

void CycleRecorder::record(std::uint64_t cycle, std::span<const Reading> readings,
                           const ControllerState& controller, const OffsetCommand& command,
                           const Estimator& estimator) noexcept {
  THERMOCOMP_ENSURE(readings.size() == readings_.size());
  push_readings(cycle, readings);
  push_controller(cycle, controller);
  if (cycle >= next_offsets_) {
    push_offsets(cycle, command);
    next_offsets_ = next_multiple(cycle, offsets_every_);
    push_done(cycle);
  } else if (cycle >= next_done_) {
    push_done(cycle);
  }
  if (!broken_) last_whole_cycle_ = static_cast<std::int64_t>(cycle);

  const std::uint8_t requested = session_->requested.load(std::memory_order_relaxed);
  if (requested != 0) {
    const auto reason = broken_ ? broken_reason_ : static_cast<SegmentReason>(requested - 1);
    if (snapshot(cycle + 1, estimator, reason)) {
      session_->requested.store(0, std::memory_order_relaxed);
    }
  } else if (broken_ && ring_.free_places() > ring_.capacity() / 2) {
    // Only after the writer has caught up, since the new segment would otherwise break at once.
    snapshot(cycle + 1, estimator, broken_reason_);
  }
}

void CycleRecorder::finish(std::uint64_t last_cycle, const OffsetCommand& command) noexcept {
  if (noted_cycle_ != static_cast<std::int64_t>(last_cycle)) push_offsets(last_cycle, command);
  push_done(last_cycle);
}

void CycleRecorder::push(const Record& record) noexcept {
  if (broken_) {
    ring_.count_lost(1);
  } else if (!ring_.try_push(record)) {
    lose();
  }
}

void CycleRecorder::push_readings(std::uint64_t cycle, std::span<const Reading> readings) noexcept {
  for (std::size_t i = 0; i < readings.size(); ++i) {
    if (same(readings[i], readings_[i])) continue;
    readings_[i] = readings[i];
    Record record;
    record.cycle = cycle;
    record.time_ns = readings[i].taken_at.count();
    record.value = readings[i].temp_degC;
    record.index = static_cast<std::uint32_t>(i);
    record.kind = RecordKind::reading;
    record.detail = static_cast<std::uint8_t>(readings[i].fault);
    push(record);
  }
}

void CycleRecorder::push_controller(std::uint64_t cycle,
                                    const ControllerState& controller) noexcept {
  if (controller.taken_at != controller_.taken_at ||
      controller.link_epoch != controller_.link_epoch || controller.online != controller_.online ||
      controller.written != controller_.written) {
    controller_.taken_at = controller.taken_at;
    controller_.link_epoch = controller.link_epoch;
    controller_.online = controller.online;
    controller_.written = controller.written;
    Record record;
    record.cycle = cycle;
    record.time_ns = controller.taken_at.count();
    record.index = controller.link_epoch;
    record.kind = RecordKind::link;
    record.detail = link_bits(controller);
    push(record);
  }
  push_values(cycle, RecordKind::applied, controller.applied_um, controller_.applied_um);
  push_values(cycle, RecordKind::signal, controller.signals, controller_.signals);
}

void CycleRecorder::push_values(std::uint64_t cycle, RecordKind kind, std::span<const double> now,
                                std::span<double> last) noexcept {
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (same_bits(now[i], last[i])) continue;
    last[i] = now[i];
    Record record;
    record.cycle = cycle;
    record.value = now[i];
    record.index = static_cast<std::uint32_t>(i);
    record.kind = kind;
    push(record);
  }
}

void CycleRecorder::push_offsets(std::uint64_t cycle, const OffsetCommand& command) noexcept {
  noted_cycle_ = static_cast<std::int64_t>(cycle);
  for (std::uint32_t axis = 0; axis < axes_; ++axis) {
    Record record;
    record.cycle = cycle;
    record.time_ns = command.link_epoch;
    record.value = command.offset_um[axis];
    record.index = axis;
    record.kind = RecordKind::offset;
    record.detail = command.valid[axis] ? 1 : 0;
    push(record);
  }
}

void CycleRecorder::push_done(std::uint64_t cycle) noexcept {
  Record record;
  record.cycle = cycle;
  record.kind = RecordKind::cycle_done;
  push(record);
  next_done_ = next_multiple(cycle, done_every_);
}

void CycleRecorder::lose() noexcept {
  ring_.count_lost(1);
  broken_ = true;
  broken_reason_ = SegmentReason::gap;
}

bool CycleRecorder::snapshot(std::uint64_t first_cycle, const Estimator& estimator,
                             SegmentReason reason) noexcept {
  for (std::size_t i = 0; i < session_->snapshots.size(); ++i) {
    Snapshot& snapshot = session_->snapshots[i];
    if (snapshot.taken.load(std::memory_order_acquire)) continue;  // the writer still reads it
    estimator.save_state(snapshot.estimator_state);
    std::copy(readings_.begin(), readings_.end(), snapshot.readings.begin());
    snapshot.controller = controller_;
    snapshot.taken.store(true, std::memory_order_relaxed);
    Record record;
    record.cycle = first_cycle;
    record.time_ns = last_whole_cycle_;
    record.index = static_cast<std::uint32_t>(i);
    record.kind = RecordKind::segment_begin;
    record.detail = static_cast<std::uint8_t>(reason);
    record.session = session_->id;
    if (ring_.try_push(record)) {
      broken_ = false;
      // Offsets of the previous cycle do not belong to the new segment.
      noted_cycle_ = static_cast<std::int64_t>(first_cycle) - 1;
      return true;
    }
    snapshot.taken.store(false, std::memory_order_relaxed);
    lose();
    return false;
  }
  return false;
}

}  // namespace thermocomp
