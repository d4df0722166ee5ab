#include "daemon/history/format/segments.hpp"

#include <algorithm>
#include <utility>

namespace thermocomp {
namespace {

constexpr std::int64_t period_ns_min = 100'000;
constexpr std::int64_t period_ns_max = 3'600'000'000'000;

std::int64_t begin_ns(const SegmentInfo& segment) {
  return segment.grid.time_of(segment.first_cycle).count();
}
std::int64_t end_ns(const SegmentInfo& segment) {
  return segment.grid.time_of(static_cast<std::uint64_t>(segment.last_cycle + 1)).count();
}

using GridKey = std::pair<std::int64_t, std::int64_t>;
GridKey grid_of(const SegmentInfo& segment) {
  return {segment.grid.start.count(), segment.grid.period.count()};
}

/// The most frequent grid of each run; in a tie the first.
std::map<std::int64_t, GridKey> usual_grids(const std::vector<SegmentInfo>& segments) {
  std::map<std::int64_t, std::map<GridKey, int>> counts;
  std::map<std::int64_t, GridKey> usual;
  for (const SegmentInfo& segment : segments) {
    auto& of_run = counts[segment.run];
    const int count = ++of_run[grid_of(segment)];
    const auto [best, is_first] = usual.emplace(segment.run, grid_of(segment));
    if (!is_first && count > of_run[best->second]) best->second = grid_of(segment);
  }
  return usual;
}

/// Wall time estimated from the same run, else the previous segment, else the next one.
std::int64_t likely_wall_ns(const std::vector<SegmentInfo>& segments, std::size_t at) {
  const SegmentInfo& segment = segments[at];
  const auto is_good = [](const SegmentInfo& other) { return is_wall_time(other.wall_ns); };
  const auto peer = std::find_if(segments.begin(), segments.end(), [&](const SegmentInfo& other) {
    return other.run == segment.run && is_good(other);
  });
  std::int64_t wall_ns = 0;
  if (peer != segments.end()) {
    wall_ns = peer->wall_ns + begin_ns(segment) - begin_ns(*peer);
  } else if (at > 0) {  // corrected already
    const SegmentInfo& before = segments[at - 1];
    wall_ns = before.wall_ns + end_ns(before) - begin_ns(before);
  } else {
    const auto behind = std::find_if(segments.begin(), segments.end(), is_good);
    if (behind != segments.end()) wall_ns = behind->wall_ns - (end_ns(segment) - begin_ns(segment));
  }
  return std::clamp<std::int64_t>(wall_ns, 0, wall_ns_max);
}

}  // namespace

std::string to_string(const HistoryDamage& damage) {
  return damage.segment == 0 ? damage.why
                             : "segment " + std::to_string(damage.segment) + ": " + damage.why;
}

void check_times(const SegmentInfo& segment) {
  const std::int64_t period_ns = segment.grid.period.count();
  const std::int64_t start_ns = segment.grid.start.count();
  const auto first = static_cast<std::int64_t>(segment.first_cycle);
  require_sound(period_ns >= period_ns_min && period_ns <= period_ns_max,
                "a period that cannot be");
  require_sound(start_ns >= 0 && start_ns <= grid_ns_max, "the start of a grid that cannot be");
  require_sound(first >= 0 && first <= (grid_ns_max - start_ns) / period_ns,
                "a cycle that cannot be");
  require_sound(
      segment.last_cycle >= first - 1 && segment.last_cycle - first < span_ns_max / period_ns,
      "a last cycle that cannot be");
}

std::string HistoryPlaces::add(const SegmentInfo& segment) {
  constexpr std::int64_t end_ns_max = std::int64_t{1} << 62;  // the sum of two does not overflow
  const bool is_first = grid_to_history_ns_.empty();
  const auto known = grid_to_history_ns_.find(segment.run);
  const std::int64_t by_wall_ns = is_first ? 0 : segment.wall_ns - first_wall_ns_;
  const std::int64_t shift_ns = known != grid_to_history_ns_.end()
                                    ? known->second
                                    : std::max(by_wall_ns, end_ns_) - begin_ns(segment);
  if (begin_ns(segment) + shift_ns < end_ns_) return "begins before the one in front of it ends";
  if (end_ns(segment) + shift_ns > end_ns_max) return "has times that cannot be";
  if (is_first) first_wall_ns_ = segment.wall_ns;
  grid_to_history_ns_.emplace(segment.run, shift_ns);
  end_ns_ = end_ns(segment) + shift_ns;
  return {};
}

double HistoryPlaces::seconds_at(const SegmentInfo& segment, std::uint64_t cycle) const {
  const std::int64_t time_ns =
      segment.grid.time_of(cycle).count() + grid_to_history_ns_.at(segment.run);
  return static_cast<double>(time_ns) * 1e-9;
}

std::vector<SegmentInfo> sound_segments(std::vector<SegmentInfo> segments, HistoryPlaces& places,
                                        std::vector<HistoryDamage>& damage) {
  const std::map<std::int64_t, GridKey> grids = usual_grids(segments);
  std::erase_if(segments, [&](const SegmentInfo& segment) {
    if (grid_of(segment) == grids.at(segment.run)) return false;
    damage.push_back({segment.id, "its period or its grid's start is not that of its run"});
    return true;
  });
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (is_wall_time(segments[i].wall_ns)) continue;
    segments[i].wall_ns = likely_wall_ns(segments, i);
    damage.push_back({segments[i].id,
                      "its wall time is impossible (clock set wrong?); its records are used, at "
                      "the most likely time"});
  }
  std::vector<SegmentInfo> sound;
  for (SegmentInfo& segment : segments) {
    const std::string why = places.add(segment);
    if (why.empty()) {
      sound.push_back(std::move(segment));
    } else {
      damage.push_back({segment.id, why});
    }
  }
  return sound;
}

}  // namespace thermocomp
