#include "daemon/history/replay/segment_walk.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/daemon/daemon_config.hpp"
#include "config/text/printable_text.hpp"
#include "daemon/history/format/chunk_codec.hpp"

namespace thermocomp {

void InputsInForce::apply(const Record& record) {
  const auto require_below = [&](std::size_t size) {
    require_sound(record.index < size, "a record names what does not exist");
  };
  switch (record.kind) {
    case RecordKind::reading: {
      const nanoseconds taken_at = grid_time_from(record.time_ns);
      require_below(readings.size());
      readings[record.index] = {record.value, taken_at, fault_from(record.detail)};
      break;
    }
    case RecordKind::link:
      controller.taken_at = grid_time_from(record.time_ns);
      controller.link_epoch = record.index;
      set_link_bits(record.detail, controller);
      break;
    case RecordKind::applied:
      require_below(controller.applied_um.size());
      controller.applied_um[record.index] = record.value;
      break;
    case RecordKind::signal:
      require_below(controller.signals.size());
      controller.signals[record.index] = record.value;
      break;
    default:
      throw HistoryError("damaged: a record of this kind has no place here");
  }
}

void InputsInForce::forget() {
  for (Reading& reading : readings) reading = {};
  controller.applied_um.fill(not_a_number);
  controller.signals.fill(not_a_number);
}

InputsInForce inputs_at(const SegmentStart& start, const EstimatorConfig& config) {
  require_sound(start.readings.size() == config.sensors.size(),
                "the inputs at its start do not fit its configuration");
  return {start.readings, start.controller};
}

bool is_in_a_block(const EstimatorConfig& config, std::size_t sensor) {
  return std::any_of(config.blocks.begin(), config.blocks.end(), [&](const BlockConfig& block) {
    return std::find(block.sensors.begin(), block.sensors.end(), sensor) != block.sensors.end();
  });
}

ReplaySetup parse_setup(const SegmentSetup& setup) {
  DaemonConfig config = parse_daemon_config(setup.config_text, "configuration of the segment",
                                            setup.model_text, "model of the segment");
  return {std::move(config.estimator), std::move(config.model), config.dry_run};
}

ParsedSetups::ParsedSetups(const HistoryReader& reader, const SetupParser& parser) {
  for (const SegmentInfo& segment : reader.segments()) {
    if (setups_.count(segment.setup) != 0 || failures_.count(segment.setup) != 0) continue;
    try {
      setups_.emplace(segment.setup, parser(reader.setup(segment)));
    } catch (const std::exception& error) {
      failures_.emplace(segment.setup, error.what());
    }
  }
}

const ReplaySetup& ParsedSetups::of(const SegmentInfo& segment) const {
  if (const ReplaySetup* setup = find(segment)) return *setup;
  throw HistoryError("its configuration cannot be used: " + failures_.at(segment.setup));
}

const ReplaySetup* ParsedSetups::find(const SegmentInfo& segment) const {
  const auto found = setups_.find(segment.setup);
  return found == setups_.end() ? nullptr : &found->second;
}

std::string damage_line(const HistoryDamage& damage) {
  return "# damaged: " + printable_text(to_string(damage)) + "\n";
}

std::size_t RunColumns::column(const std::string& name) {
  const auto [place, is_new] = indices_.emplace(name, names_.size());
  if (is_new) names_.push_back(name);
  return place->second;
}

void append_row(std::string& text, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += ',';
    if (!std::isnan(values[i])) append_number(text, values[i]);
  }
  text += '\n';
}

void append_header(std::string& text, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += ',';
    text += names[i];
  }
  text += '\n';
}

SegmentSteps::SegmentSteps(const HistoryReader& reader, const SegmentInfo& segment,
                           const ReplaySetup& setup)
    : segment_(segment),
      estimator_(setup.estimator, setup.model),
      cursor_(reader, segment),
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
  // Skips unread offsets of the previous step.
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

/// Applies all records before the step of `cycle`.
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
