#include "daemon/history/replay/segment_steps.hpp"

#include <utility>

namespace thermocomp {

SegmentSteps::SegmentSteps(const HistoryReader& reader, const SegmentInfo& segment,
                           const ReplaySetup& setup)
    : segment_(segment),
      estimator_(setup.estimator, setup.model),
      cursor_(reader.records(segment)),
      next_cycle_(segment.first_cycle) {
  const SegmentStart start = reader.start(segment);
  estimator_.load_state(start.estimator_state);
  Report report = estimator_.make_report();
  estimator_.report(report);
  require_sound(segment.grid.time_of(segment.first_cycle) >= report.now,
                "the state at its start is of a later time");
  inputs_ = inputs_at(start, estimator_.config());
  next();
}

bool SegmentSteps::step() {
  // What was noted after the step before and nobody asked for.
  while (noted_offset() != nullptr) next();
  const auto end = static_cast<std::uint64_t>(segment_.last_cycle + 1);
  while (next_cycle_ < end) {
    const std::uint64_t first_stepped = take_inputs(next_cycle_);
    const bool is_stepped = first_stepped == next_cycle_;
    if (is_stepped) {
      cycle_ = next_cycle_++;
      stepped_ = true;
      estimator_.step(segment_.grid.time_of(cycle_), inputs_.readings, inputs_.controller,
                      command_);
      return true;
    }
    next_cycle_ = first_stepped;
  }
  return false;
}

/// Everything that reached the estimator before the step of `cycle`.
/// @return `cycle`, or the first cycle after those that were skipped
std::uint64_t SegmentSteps::take_inputs(std::uint64_t cycle) {
  while (has_record_ && record_.cycle <= cycle && record_.kind != RecordKind::offset) {
    require_sound(record_.cycle >= cycle, "records are out of order");
    if (record_.kind == RecordKind::skipped) {
      require_sound(record_.time_ns >= static_cast<std::int64_t>(cycle),
                    "skipped cycles end before they begin");
      require_sound(record_.time_ns <= segment_.last_cycle, "skipped cycles end after the segment");
      const auto after = static_cast<std::uint64_t>(record_.time_ns) + 1;
      next();
      return after;
    }
    if (record_.kind == RecordKind::command) {
      require_sound(record_.detail < command_kinds_count, "unknown command");
      Command command{static_cast<CommandKind>(record_.detail), record_.index, record_.value};
      set_measured_bits(record_.time_ns, command);
      estimator_.apply(command);
    } else {
      inputs_.apply(record_);
    }
    next();
  }
  return cycle;
}

}  // namespace thermocomp
