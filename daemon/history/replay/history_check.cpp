#include "daemon/history/replay/history_check.hpp"

#include <algorithm>
#include <utility>

#include "daemon/history/replay/segment_walk.hpp"

namespace thermocomp {
namespace {

/// Calls `look`; what it throws is damage of the segment.
template <class Look>
bool is_good(SegmentCheck& check, Look look) {
  try {
    look();
    return true;
  } catch (const std::exception& error) {
    constexpr std::size_t told_max = 10;
    if (check.damage.size() < told_max) check.damage.push_back({check.segment.id, error.what()});
    return false;
  }
}

void require(bool holds, const char* why) {
  if (!holds) throw HistoryError(why);
}

/// What a record says must be possible for the configuration.
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
  RecordCursor cursor = reader.records(check.segment);
  InputsInForce inputs;
  inputs.readings.resize(config.sensors.size());
  Record record;
  for (bool goes_on = true; goes_on;) {
    const bool is_sound = is_good(check, [&] {
      for (; cursor.next(record); ++check.records) {
        is_good(check, [&] { check_record(record, config, inputs); });
      }
    });
    goes_on = !is_sound && cursor.resume();
  }
  if (cursor.wall_time_was_impossible()) {
    check.damage.push_back({check.segment.id, "a wall time cannot be (a clock set wrong?)"});
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
    // Without its configuration nothing of a segment can be judged.
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
