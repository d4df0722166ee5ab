#include "daemon/history/replay/replay.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ostream>
#include <utility>

#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t progress_every = 1u << 16;  ///< steps

/// Recorded offsets of all axes at one cycle.
struct NotedOffsets {
  std::array<double, axes_max> offset_um{};
  std::array<bool, axes_max> valid{};
  std::uint32_t link_epoch{0};
  std::size_t axes{0};
};

class SegmentReplay {
 public:
  SegmentReplay(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup,
                const OffsetSink& sink, ReplaySummary& summary)
      : reader_(reader),
        segment_(segment),
        steps_(reader, segment, setup),
        sink_(sink),
        summary_(summary) {}

  /// @param each  called from time to time with the cycles done
  void run(const std::function<void(std::uint64_t)>& each) {
    while (steps_.step()) {
      ++summary_.cycles;
      if (steps_.noted_offset() != nullptr) take_offsets(steps_.cycle());
      const std::uint64_t next = steps_.cycle() + 1;
      if (next % progress_every == 0) each(next - segment_.first_cycle);
    }
  }

 private:
  void take_offsets(std::uint64_t cycle) {
    NotedOffsets noted;
    const EstimatorConfig& config = steps_.estimator().config();
    while (const Record* record = steps_.noted_offset()) {
      if (record->index >= config.axes.size()) throw HistoryError("damaged: an offset of no axis");
      noted.offset_um[record->index] = record->value;
      noted.valid[record->index] = record->detail != 0;
      noted.link_epoch = static_cast<std::uint32_t>(record->time_ns);
      noted.axes = record->index + std::size_t{1};
      steps_.next();
    }
    compare(cycle, noted);
    if (!sink_) return;
    sink_({reader_.seconds_at(segment_, cycle), cycle, &config,
           std::span<const double>(steps_.command().offset_um).first(noted.axes),
           std::span<const double>(noted.offset_um).first(noted.axes)});
  }

  void compare(std::uint64_t cycle, const NotedOffsets& noted) {
    const OffsetCommand& command = steps_.command();
    for (std::size_t axis = 0; axis < noted.axes; ++axis) {
      ++summary_.compared;
      if (same_bits(command.offset_um[axis], noted.offset_um[axis]) &&
          command.valid[axis] == noted.valid[axis] && command.link_epoch == noted.link_epoch) {
        continue;
      }
      ++summary_.different;
      const double difference_um = std::abs(command.offset_um[axis] - noted.offset_um[axis]);
      if (!(difference_um <= summary_.largest_difference_um)) {
        summary_.largest_difference_um = difference_um;
      }
      if (!summary_.first_different_cycle) {
        summary_.first_different_cycle = cycle;
        summary_.first_different_time_s = reader_.seconds_at(segment_, cycle);
      }
    }
  }

  const HistoryReader& reader_;
  const SegmentInfo& segment_;
  SegmentSteps steps_;
  const OffsetSink& sink_;
  ReplaySummary& summary_;
};

std::uint64_t cycles_of(const SegmentInfo& segment) {
  return static_cast<std::uint64_t>(segment.last_cycle + 1) - segment.first_cycle;
}

using DamageSink = std::function<void(const HistoryDamage&)>;

ReplaySummary replay_all(const HistoryReader& reader, const ParsedSetups& setups,
                         const OffsetSink& sink, const DamageSink& on_damage,
                         const Progress& progress) {
  ReplaySummary summary;
  const auto note = [&](const HistoryDamage& damage) {
    if (on_damage) on_damage(damage);
    summary.damage.push_back(damage);
  };
  for (const HistoryDamage& damage : reader.damage()) note(damage);
  std::uint64_t total = 0;
  for (const SegmentInfo& segment : reader.segments()) total += cycles_of(segment);
  std::uint64_t done = 0;
  for (const SegmentInfo& segment : reader.segments()) {
    if (segment.reason == SegmentReason::gap) ++summary.gaps;
    try {
      SegmentReplay replayed(reader, segment, setups.of(segment), sink, summary);
      replayed.run([&](std::uint64_t cycles) {
        if (progress) progress(static_cast<double>(done + cycles) / static_cast<double>(total));
      });
      ++summary.segments;
    } catch (const std::exception& error) {
      note({segment.id, "(written by version " + segment.program_version +
                            ") cannot be replayed: " + error.what()});
    }
    done += cycles_of(segment);
  }
  if (progress) progress(1.0);
  return summary;
}

}  // namespace

std::string sensor_column(const std::string& sensor) {
  constexpr std::string_view unit = "_degC";
  const bool has_unit = sensor.size() > unit.size() && sensor.ends_with(unit);
  return has_unit ? sensor : sensor + std::string(unit);
}

ReplaySummary replay(const std::filesystem::path& history, const OffsetSink& sink,
                     const Progress& progress, const SetupParser& parser) {
  const HistoryReader reader(history);
  const ParsedSetups setups(reader, parser);
  return replay_all(reader, setups, sink, {}, progress);
}

ReplaySummary replay_to_csv(const std::filesystem::path& history, std::ostream& out,
                            const Progress& progress, const SetupParser& parser) {
  const HistoryReader reader(history);
  const ParsedSetups setups(reader, parser);
  RunColumns columns;
  columns.column("time_s");
  for (const auto& [id, setup] : setups.all()) {
    for (const AxisConfig& axis : setup.estimator.axes) {
      columns.column(axis.name + "_offset_um");
      columns.column(axis.name + "_recorded_um");
    }
  }
  std::string text;
  append_header(text, columns.names());
  std::vector<double> row(columns.names().size());
  const OffsetSink sink = [&](const ReplayedOffsets& offsets) {
    std::fill(row.begin(), row.end(), not_a_number);
    row[0] = offsets.time_s;
    for (std::size_t axis = 0; axis < offsets.offset_um.size(); ++axis) {
      const std::string& name = offsets.config->axes[axis].name;
      row[columns.column(name + "_offset_um")] = offsets.offset_um[axis];
      row[columns.column(name + "_recorded_um")] = offsets.recorded_um[axis];
    }
    append_row(text, row);
    out << text;
    text.clear();
  };
  const DamageSink on_damage = [&](const HistoryDamage& damage) { text += damage_line(damage); };
  ReplaySummary summary = replay_all(reader, setups, sink, on_damage, progress);
  out << text;
  return summary;
}

namespace {

/// Calls `look` and turns an exception into damage of the segment.
template <class Look>
bool is_good(SegmentCheck& check, Look look) {
  try {
    look();
    return true;
  } catch (const std::exception& error) {
    constexpr std::size_t shown_max = 10;
    if (check.damage.size() < shown_max) check.damage.push_back({check.segment.id, error.what()});
    return false;
  }
}

void require(bool holds, const char* why) {
  if (!holds) throw HistoryError(why);
}

/// Checks a record's indices and values against the configuration.
void check_record(const Record& record, const EstimatorConfig& config, InputsInForce& inputs) {
  switch (record.kind) {
    case RecordKind::offset:
      return require(record.index < config.axes.size(), "an offset of no axis");
    case RecordKind::command:
      return require(record.detail < command_kinds_count, "an unknown command");
    case RecordKind::skipped:
      return require(record.time_ns >= static_cast<std::int64_t>(record.cycle),
                     "skipped cycles end before they begin");
    default:
      return inputs.apply(record);
  }
}

void check_records(const HistoryReader& reader, const EstimatorConfig& config,
                   SegmentCheck& check) {
  RecordCursor cursor(reader, check.segment);
  InputsInForce inputs;
  inputs.readings.resize(config.sensors.size());
  Record record;
  for (bool has_more = true; has_more;) {
    const bool is_sound = is_good(check, [&] {
      for (; cursor.next(record); ++check.records) {
        is_good(check, [&] { check_record(record, config, inputs); });
      }
    });
    has_more = !is_sound && cursor.resume();
  }
  if (cursor.wall_time_was_impossible()) {
    check.damage.push_back({check.segment.id, "a wall time is impossible (clock set wrong?)"});
  }
}

}  // namespace

bool HistoryCheck::is_sound() const noexcept {
  return damage.empty() && std::all_of(segments.begin(), segments.end(),
                                       [](const auto& check) { return check.damage.empty(); });
}

HistoryCheck check_history(const std::filesystem::path& history, const Progress& progress,
                           const SetupParser& parser) {
  const HistoryReader reader(history);
  const ParsedSetups setups(reader, parser);
  HistoryCheck result;
  for (const SegmentInfo& segment : reader.segments()) {
    SegmentCheck check{segment, 0, {}};
    for (const HistoryDamage& damage : reader.damage()) {
      if (damage.segment == segment.id) check.damage.push_back(damage);
    }
    // A segment's records cannot be checked without its configuration.
    is_good(check, [&] {
      const EstimatorConfig& config = setups.of(segment).estimator;
      is_good(check, [&] { static_cast<void>(inputs_at(reader.start(segment), config)); });
      check_records(reader, config, check);
    });
    result.segments.push_back(std::move(check));
    if (progress) {
      progress(static_cast<double>(result.segments.size()) /
               static_cast<double>(reader.segments().size()));
    }
  }
  for (const HistoryDamage& damage : reader.damage()) {
    const bool is_read =
        std::any_of(result.segments.begin(), result.segments.end(),
                    [&](const SegmentCheck& check) { return check.segment.id == damage.segment; });
    if (!is_read) result.damage.push_back(damage);
  }
  return result;
}

}  // namespace thermocomp
