#include "daemon/history/replay/thinned_history.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/database.hpp"
#include "daemon/history/format/history_time.hpp"
#include "daemon/history/format/segments.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// Sums of the values in each interval.
class Means {
 public:
  explicit Means(std::size_t points) : sum_(points, 0.0), count_(points, 0) {}
  void add(std::size_t point, double value) {
    sum_[point] += value;
    ++count_[point];
  }
  [[nodiscard]] std::vector<double> values() const {
    std::vector<double> means(sum_.size(), not_a_number);
    for (std::size_t i = 0; i < means.size(); ++i)
      if (count_[i] > 0) means[i] = sum_[i] / static_cast<double>(count_[i]);
    return means;
  }

 private:
  std::vector<double> sum_;
  std::vector<std::uint32_t> count_;
};

/// Wall time of the history's beginning; NaN: nothing is recorded.
double begins_s(const HistoryReader& reader) {
  constexpr double wander_s = 1.0;  // possible clock drift before the first commit
  double first_s = not_a_number;
  for (const SegmentInfo& segment : reader.segments())
    first_s = std::fmin(first_s, 1e-9 * static_cast<double>(segment.wall_ns) - wander_s);
  return first_s;
}

/// The later of `from_s` and the history's beginning, if that is before `to_s`.
double stretch_from(const HistoryReader& reader, double from_s, double to_s) {
  const double first_s = begins_s(reader);
  return first_s < to_s ? std::max(from_s, first_s) : from_s;
}

/// Chunks of a segment within the stretch: [first, end) of their numbers.
struct ChunkRange {
  const SegmentInfo* segment{nullptr};
  std::int64_t first{0};
  std::int64_t end{0};
};

/// Column indices for the values of one configuration.
struct Places {
  std::vector<std::size_t> sensors;
  std::vector<std::size_t> offsets;
};

class Thinning {
 public:
  Thinning(const std::filesystem::path& file, double from_s, double to_s, std::size_t points,
           const SetupParser& parser)
      : reader_(file),
        file_(file),
        database_(file, DatabaseMode::read_only),
        setups_(reader_, parser),
        from_s_(stretch_from(reader_, from_s, to_s)),
        span_s_((to_s - from_s_) / static_cast<double>(points)),
        points_(points) {
    result_.damage = reader_.damage();
    result_.from_s = from_s_;
    result_.begins_s = begins_s(reader_);
  }

  ThinnedHistory run(std::uint64_t chunks_max) {
    const std::vector<ChunkRange> ranges = chunk_ranges();
    for (const ChunkRange& range : ranges)
      result_.chunks += static_cast<std::uint64_t>(range.end - range.first);
    const std::uint64_t step_by = std::max<std::uint64_t>(
        1, (result_.chunks + chunks_max - 1) / std::max<std::uint64_t>(1, chunks_max));
    std::uint64_t passed = 0;
    for (const ChunkRange& range : ranges)
      for (std::int64_t number = range.first; number < range.end; ++number)
        if (passed++ % step_by == 0) take(*range.segment, number);
    for (std::size_t i = 0; i < points_; ++i)
      result_.time_s.push_back(from_s_ + (static_cast<double>(i) + 0.5) * span_s_);
    for (std::size_t i = 0; i < means_.size(); ++i)
      result_.columns.push_back({columns_.names()[i], means_[i].values()});
    add_events();
    return std::move(result_);
  }

 private:
  /// Cycle of a segment at a wall time, by the clock difference at its start. The difference drifts
  /// by seconds at most within hours; chunk_ranges() adds 10 s at either end.
  [[nodiscard]] static double cycle_at(const SegmentInfo& segment, double wall_s) {
    const double since_s = wall_s - 1e-9 * static_cast<double>(segment.wall_ns);
    return static_cast<double>(segment.first_cycle) +
           since_s * 1e9 / static_cast<double>(segment.grid.period.count());
  }

  void add_events() {
    constexpr double probings_back_s = 30.0 * 86400.0;
    constexpr double modes_back_s = 86400.0;
    const auto time_of = [](double wall_s) {
      return HistoryTime{.seconds = {}, .wall_ns = std::llround(1e9 * wall_s)};
    };
    const double to_s = from_s_ + span_s_ * static_cast<double>(points_);
    for (RecordedEvent& event :
         read_events(file_, time_of(from_s_ - probings_back_s), time_of(to_s))) {
      if (event.kind == EventKind::command && event.code == to_string(CommandKind::measured))
        add_probing(event);
      if (event.wall_s >= from_s_ - modes_back_s) result_.events.push_back(std::move(event));
    }
  }

  void add_probing(const Event& event) {
    const bool is_of_stretch = event.wall_s >= from_s_;
    const auto is_older = [&](const Probing& other) {
      return other.axis == event.subject.name && other.time_s < from_s_;
    };
    std::erase_if(result_.probings, is_older);
    Probing probing{event.subject.name, event.wall_s, event.value, not_a_number};
    const SegmentInfo* segment = nullptr;
    for (const SegmentInfo& each : reader_.segments())
      if (1e-9 * static_cast<double>(each.wall_ns) <= event.wall_s) segment = &each;
    if (segment == nullptr || !open_setup(*segment)) return;
    const EstimatorConfig& config = setups_.of(*segment).estimator;
    for (const AxisConfig& axis : config.axes) {
      if (axis.name != event.subject.name) continue;
      const double offset_um = is_of_stretch ? offset_at(axis.name, event.wall_s) : not_a_number;
      const bool remains = config.correction.measured == MeasuredMeaning::remaining;
      probing.left_um = remains ? event.value : event.value + axis.sign * offset_um;
      probing.needed_um = remains ? offset_um - axis.sign * event.value : -axis.sign * event.value;
      result_.probings.push_back(std::move(probing));
      return;
    }
  }

  /// Last recorded offset: an interval may be shorter than the time between two records.
  [[nodiscard]] double offset_at(const std::string& axis, double wall_s) const {
    for (const ThinnedColumn& column : result_.columns) {
      if (column.name != axis + "_offset_um") continue;
      for (auto point = static_cast<std::size_t>((wall_s - from_s_) / span_s_) + 1; point-- > 0;)
        if (point < points_ && std::isfinite(column.values[point])) return column.values[point];
    }
    return not_a_number;
  }

  [[nodiscard]] std::vector<ChunkRange> chunk_ranges() {
    std::vector<ChunkRange> ranges;
    constexpr double wander_s = 10.0;
    const double to_s = from_s_ + span_s_ * static_cast<double>(points_);
    for (const SegmentInfo& segment : reader_.segments()) {
      const double first = cycle_at(segment, from_s_ - wander_s);
      const double last = cycle_at(segment, to_s + wander_s);
      if (first > static_cast<double>(segment.last_cycle) ||
          last < static_cast<double>(segment.first_cycle))
        continue;
      if (!open_setup(segment)) continue;
      ChunkRange range{
          &segment, 0,
          database_.number("SELECT max(number) + 1 FROM chunk WHERE segment = ?", segment.id)};
      range.first = first_reaching(segment, range.end, first);
      range.end = std::min(range.end, first_reaching(segment, range.end, last) + 1);
      ranges.push_back(range);
    }
    return ranges;
  }

  bool open_setup(const SegmentInfo& segment) {
    if (places_.count(segment.setup) != 0) return true;
    try {
      const EstimatorConfig& config = setups_.of(segment).estimator;
      Places places;
      for (const SensorConfig& sensor : config.sensors)
        places.sensors.push_back(column(sensor_column(sensor.name)));
      for (const AxisConfig& axis : config.axes)
        places.offsets.push_back(column(axis.name + "_offset_um"));
      places_.emplace(segment.setup, std::move(places));
      return true;
    } catch (const HistoryError& error) {
      note(segment.id, error.what());
      return false;
    }
  }

  std::size_t column(const std::string& name) {
    const std::size_t place = columns_.column(name);
    if (place == means_.size()) means_.emplace_back(points_);
    return place;
  }

  /// The first chunk that reaches the cycle, by bisection; `end` if none does.
  std::int64_t first_reaching(const SegmentInfo& segment, std::int64_t end, double cycle) {
    std::int64_t low = 0;
    std::int64_t high = end;
    while (low < high) {
      const std::int64_t middle = low + (high - low) / 2;
      Statement probe(database_,
                      "SELECT through_cycle FROM chunk WHERE segment = ? AND number >= ?"
                      " ORDER BY number LIMIT 1",
                      segment.id, middle);
      const bool reaches = !probe.step() || static_cast<double>(probe.number(0)) >= cycle;
      if (reaches)
        high = middle;
      else
        low = middle + 1;
    }
    return low;
  }

  void take(const SegmentInfo& segment, std::int64_t number) {
    try {
      std::optional<ChunkContent> content = read_chunk(database_, segment.id, number);
      if (!content) return;  // deleted meanwhile, or missing: its interval stays empty
      ++result_.chunks_read;
      add_records(segment, std::move(*content));
    } catch (const HistoryError& error) {
      note(segment.id, error.what());
    }
  }

  void add_records(const SegmentInfo& segment, ChunkContent content) {
    const auto count = static_cast<std::uint64_t>(content.count);
    require_sound(count <= content.records.size(), "more records than bytes");
    const bool is_sound =
        content.wall_minus_grid_ns >= -grid_ns_max && content.wall_minus_grid_ns <= wall_ns_max;
    const std::int64_t difference_ns =
        is_sound ? content.wall_minus_grid_ns
                 : segment.wall_ns - segment.grid.time_of(segment.first_cycle).count();
    const Places& places = places_.at(segment.setup);
    ChunkDecoder chunk(std::move(content.records), count);
    for (Record record; chunk.next(record);) {
      if (record.cycle > static_cast<std::uint64_t>(segment.last_cycle)) break;
      const std::optional<std::size_t> place = place_of(record, places);
      if (!place || !std::isfinite(record.value)) continue;
      const double wall_s =
          1e-9 * static_cast<double>(segment.grid.time_of(record.cycle).count() + difference_ns);
      const double point = std::floor((wall_s - from_s_) / span_s_);
      if (point >= 0.0 && point < static_cast<double>(points_))
        means_[*place].add(static_cast<std::size_t>(point), record.value);
    }
  }

  [[nodiscard]] static std::optional<std::size_t> place_of(const Record& record,
                                                           const Places& places) {
    if (record.kind == RecordKind::offset && record.index < places.offsets.size())
      return places.offsets[record.index];
    const bool is_good = record.detail == static_cast<std::uint8_t>(Fault::none);
    if (record.kind == RecordKind::reading && is_good && record.index < places.sensors.size())
      return places.sensors[record.index];
    return std::nullopt;
  }

  void note(std::int64_t segment, const std::string& why) {
    constexpr std::size_t shown_max = 20;
    if (result_.damage.size() < shown_max) result_.damage.push_back({segment, why});
  }

  HistoryReader reader_;
  std::filesystem::path file_;
  Database database_;
  ParsedSetups setups_;
  double from_s_;
  double span_s_;
  std::size_t points_;
  RunColumns columns_;
  std::vector<Means> means_;               ///< one per column
  std::map<std::int64_t, Places> places_;  ///< by setup
  ThinnedHistory result_;
};

}  // namespace

ThinnedHistory thin_history(const std::filesystem::path& file, double from_s, double to_s,
                            std::size_t points, const ThinningLimits& limits,
                            const SetupParser& parser) {
  if (!(to_s > from_s && std::isfinite(from_s) && std::isfinite(to_s)))
    throw std::invalid_argument("to must be later than from");
  if (points < 1 || points > limits.points_max)
    throw std::invalid_argument("points must be in [1, " + std::to_string(limits.points_max) + "]");
  return Thinning(file, from_s, to_s, points, parser).run(limits.chunks_max);
}

}  // namespace thermocomp
