#include "daemon/history/history_check.hpp"

#include <algorithm>
#include <utility>

#include "daemon/history/segment_walk.hpp"

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

void check_records(const HistoryReader& reader, SegmentCheck& check) {
  RecordCursor cursor = reader.records(check.segment);
  Record record;
  for (bool goes_on = true; goes_on;) {
    const bool is_sound = is_good(check, [&] {
      while (cursor.next(record)) ++check.records;
    });
    goes_on = !is_sound && cursor.resume();
  }
  if (cursor.wall_time_was_impossible()) {
    check.damage.push_back({check.segment.id, "a wall time cannot be (a clock set wrong?)"});
  }
}

void check_start(const HistoryReader& reader, const ParsedSetups& setups, SegmentCheck& check) {
  is_good(check, [&] {
    const std::size_t sensors = setups.of(check.segment).estimator.sensors.size();
    if (reader.start(check.segment).readings.size() != sensors) {
      throw HistoryError("the inputs at its start do not fit its configuration");
    }
  });
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
    check_start(reader, setups, check);
    check_records(reader, check);
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
