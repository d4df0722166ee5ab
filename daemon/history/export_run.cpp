#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <ostream>
#include <stdexcept>

#include "daemon/history/replay.hpp"
#include "daemon/history/segment_walk.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t no_column = static_cast<std::size_t>(-1);

/// Where the values of one configuration go.
struct SetupColumns {
  std::vector<std::size_t> sensors;
  std::vector<std::size_t> blocks;  ///< no_column where a sensor's column has that name
  std::vector<std::size_t> signals;
  std::vector<std::size_t> offsets;
  std::vector<std::size_t> applied;
  std::vector<std::size_t> measured;
};

SetupColumns columns_for(const EstimatorConfig& config, RunColumns& columns) {
  SetupColumns place;
  std::vector<std::string> sensor_names;
  for (const SensorConfig& sensor : config.sensors) {
    sensor_names.push_back(sensor_column(sensor.name));
    place.sensors.push_back(columns.column(sensor_names.back()));
  }
  for (const BlockConfig& block : config.blocks) {
    const bool is_taken =
        std::find(sensor_names.begin(), sensor_names.end(), block.input) != sensor_names.end();
    place.blocks.push_back(is_taken ? no_column : columns.column(block.input));
  }
  for (const std::string& signal : config.signals) {
    place.signals.push_back(columns.column(signal));
  }
  for (const AxisConfig& axis : config.axes) {
    place.offsets.push_back(columns.column(axis.name + "_offset_um"));
    place.applied.push_back(columns.column(axis.name + "_applied_um"));
    place.measured.push_back(columns.column(axis.name + "_measured_um"));
  }
  return place;
}

double good_value(const Reading& reading) {
  return reading.fault == Fault::none ? reading.temp_degC : not_a_number;
}

/// Mean of the block's good sensors, each as a difference where it has a reference sensor.
double block_value(const BlockConfig& block, const EstimatorConfig& config,
                   const std::vector<Reading>& readings) {
  double sum = 0.0;
  int count = 0;
  for (const std::size_t sensor : block.sensors) {
    double value = good_value(readings[sensor]);
    if (const auto reference = config.sensors[sensor].reference_sensor) {
      value -= good_value(readings[*reference]);
    }
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : not_a_number;
}

class SegmentExport {
 public:
  /// @param damage  what is found on the way
  SegmentExport(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup,
                const SetupColumns& place, std::vector<HistoryDamage>& damage)
      : segment_(segment),
        config_(setup.estimator),
        dry_run_(setup.dry_run),
        place_(place),
        damage_(damage),
        cursor_(reader.records(segment)) {
    SegmentStart start = reader.start(segment);
    if (start.readings.size() != config_.sensors.size()) {
      throw HistoryError("damaged: the inputs at its start do not fit its configuration");
    }
    inputs_.readings = std::move(start.readings);
    inputs_.controller = start.controller;
    measured_um_.fill(not_a_number);
    offset_um_.fill(not_a_number);
    advance();
  }

  /// Goes on to the next cycle whose offsets were noted. @return false when there is none
  bool next(std::uint64_t& cycle) {
    while (has_record_) {
      if (record_.kind == RecordKind::offset) {
        cycle = record_.cycle;
        take_offsets();
        return true;
      }
      take_input();
      advance();
    }
    if (cursor_.wall_time_was_impossible()) {
      note("a wall time cannot be (a clock set wrong?); what was recorded is taken");
    }
    return false;
  }

  [[nodiscard]] std::int64_t wall_ns(std::uint64_t cycle) const {
    return segment_.grid.time_of(cycle).count() + cursor_.wall_minus_grid_ns();
  }

  /// @param row  all missing before
  void fill(std::vector<double>& row) {
    for (std::size_t i = 0; i < place_.sensors.size(); ++i) {
      row[place_.sensors[i]] = good_value(inputs_.readings[i]);
    }
    for (std::size_t i = 0; i < place_.blocks.size(); ++i) {
      if (place_.blocks[i] == no_column) continue;
      row[place_.blocks[i]] = block_value(config_.blocks[i], config_, inputs_.readings);
    }
    for (std::size_t i = 0; i < place_.signals.size(); ++i) {
      row[place_.signals[i]] = inputs_.controller.signals[i];
    }
    for (std::size_t i = 0; i < place_.offsets.size(); ++i) {
      row[place_.offsets[i]] = offset_um_[i];
      // What a dry run shows in its place was not applied.
      row[place_.applied[i]] = dry_run_ ? not_a_number : inputs_.controller.applied_um[i];
      row[place_.measured[i]] = measured_um_[i];
    }
    measured_um_.fill(not_a_number);
  }

 private:
  void note(const std::string& why) {
    constexpr int told_max = 10;
    if (++told_ <= told_max) damage_.push_back({segment_.id, why});
    if (told_ == told_max + 1) damage_.push_back({segment_.id, "and more of the kind"});
  }

  /// The next record that can be read.
  void advance() {
    for (;;) {
      try {
        has_record_ = cursor_.next(record_);
        return;
      } catch (const HistoryError& error) {
        note(error.what());
        inputs_.forget();
        offset_um_.fill(not_a_number);
        has_record_ = cursor_.resume();
        if (!has_record_) return;
      }
    }
  }

  void take_input() {
    try {
      if (record_.kind == RecordKind::command) {
        take_command();
      } else if (record_.kind != RecordKind::skipped) {
        inputs_.apply(record_);
      }
    } catch (const HistoryError& error) {
      note(error.what());
    }
  }

  void take_offsets() {
    const std::uint64_t cycle = record_.cycle;
    while (has_record_ && record_.kind == RecordKind::offset && record_.cycle == cycle) {
      if (record_.index < place_.offsets.size()) {
        offset_um_[record_.index] = record_.value;
      } else {
        note("an offset of no axis");
      }
      advance();
    }
  }
  void take_command() {
    if (record_.detail == static_cast<std::uint8_t>(CommandKind::measured) &&
        record_.index < measured_um_.size()) {
      measured_um_[record_.index] = record_.value;
    }
  }

  const SegmentInfo& segment_;
  const EstimatorConfig& config_;
  const bool dry_run_;
  const SetupColumns& place_;
  std::vector<HistoryDamage>& damage_;
  int told_{0};
  RecordCursor cursor_;
  InputsInForce inputs_;
  std::array<double, axes_max> offset_um_{};
  std::array<double, axes_max> measured_um_{};
  Record record_;
  bool has_record_{false};
};

/// A comment line where nothing is known between two segments; empty where they join.
std::string gap_line(const HistoryClock& clock, const SegmentInfo& before, const SegmentInfo& after,
                     double first_s) {
  const double from_s =
      clock.seconds_at(before, static_cast<std::uint64_t>(before.last_cycle + 1)) - first_s;
  const double to_s = clock.seconds_at(after, after.first_cycle) - first_s;
  const double period_s = std::chrono::duration<double>(after.grid.period).count();
  if (!(to_s - from_s > 0.5 * period_s)) return {};
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "# nothing is recorded from %.3f s to %.3f s: %s\n",
                from_s, to_s,
                after.reason == SegmentReason::gap ? "lost" : "the daemon ended and began again");
  return text.data();
}

/// Whether all of the segment lies beside [from, to), as far as seconds tell.
bool is_beside(const HistoryClock& clock, const SegmentInfo& segment,
               const std::optional<HistoryTime>& from, const std::optional<HistoryTime>& to) {
  const auto end = static_cast<std::uint64_t>(segment.last_cycle + 1);
  const bool is_before_it =
      from && from->seconds && clock.seconds_at(segment, end) < *from->seconds;
  return is_before_it ||
         (to && to->seconds && clock.seconds_at(segment, segment.first_cycle) >= *to->seconds);
}

bool is_before(double time_s, std::int64_t wall_ns, const HistoryTime& bound) {
  return bound.seconds ? time_s < *bound.seconds : wall_ns < *bound.wall_ns;
}

int digits(std::string_view text, std::size_t from, std::size_t count) {
  int value = -1;
  if (from + count > text.size()) return -1;
  const char* begin = text.data() + from;
  const auto [end, code] = std::from_chars(begin, begin + count, value);
  return code == std::errc() && end == begin + count && text[from] != '-' ? value : -1;
}

/// "", "Z", "+hh:mm", "-hh:mm". @return false when it is none of these
bool parse_zone(std::string_view text, bool& is_local, int& seconds_east) {
  is_local = text.empty();
  seconds_east = 0;
  if (text.empty() || text == "Z") return true;
  const int hours = digits(text, 1, 2);
  const int minutes = digits(text, 4, 2);
  if (text.size() != 6 || (text[0] != '+' && text[0] != '-') || text[3] != ':' || hours < 0 ||
      hours > 14 || minutes < 0 || minutes > 59) {
    return false;
  }
  seconds_east = (text[0] == '-' ? -1 : 1) * (hours * 3600 + minutes * 60);
  return true;
}

std::optional<std::int64_t> parse_wall_ns(std::string_view text) {
  std::tm parts{};
  const int year = digits(text, 0, 4);
  const int month = digits(text, 5, 2);
  const int day = digits(text, 8, 2);
  if (text.size() < 10 || text[4] != '-' || text[7] != '-' || year < 1970 || month < 1 ||
      month > 12 || day < 1 || day > 31) {
    return std::nullopt;
  }
  parts.tm_year = year - 1900;
  parts.tm_mon = month - 1;
  parts.tm_mday = day;
  parts.tm_isdst = -1;
  std::string_view zone;
  if (text.size() > 10) {
    const int hour = digits(text, 11, 2);
    const int minute = digits(text, 14, 2);
    const bool has_seconds = text.size() > 16 && text[16] == ':';
    const int second = has_seconds ? digits(text, 17, 2) : 0;
    if ((text[10] != 'T' && text[10] != ' ') || text.size() < 16 || text[13] != ':' || hour < 0 ||
        hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 59) {
      return std::nullopt;
    }
    parts.tm_hour = hour;
    parts.tm_min = minute;
    parts.tm_sec = second;
    zone = text.substr(has_seconds ? 19 : 16);
  }
  bool is_local = false;
  int seconds_east = 0;
  if (!parse_zone(zone, is_local, seconds_east)) return std::nullopt;
  std::tm normal = parts;
  const std::time_t seconds = is_local ? mktime(&normal) : timegm(&normal) - seconds_east;
  if (normal.tm_mday != parts.tm_mday) return std::nullopt;  // such as 31 February
  return static_cast<std::int64_t>(seconds) * 1'000'000'000;
}

}  // namespace

HistoryTime parse_history_time(const std::string& text) {
  HistoryTime time;
  double seconds = 0.0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, seconds);
  if (code == std::errc() && rest == end && std::isfinite(seconds)) {
    time.seconds = seconds;
    return time;
  }
  time.wall_ns = parse_wall_ns(text);
  if (!time.wall_ns) {
    throw std::invalid_argument("time = " + text +
                                ": must be seconds since the start of the history or a wall time"
                                " like 2026-03-01T08:30:00");
  }
  return time;
}

namespace {

/// Writes rows as the segments give them, and between them comment lines of what is missing.
class RunExport {
 public:
  RunExport(const HistoryReader& reader, const SetupParser& parser, std::ostream& out)
      : reader_(reader), setups_(reader, parser), clock_(reader), out_(out) {
    columns_.column("time_s");
    for (const auto& [id, setup] : setups_.all()) {
      places_[id] = columns_for(setup.estimator, columns_);
    }
    summary_.columns = columns_.names();
    append_header(text_, columns_.names());
    row_.resize(columns_.names().size());
    summary_.damage = reader.damage();
    tell_damage();
  }

  ExportSummary run(const std::optional<HistoryTime>& from, const std::optional<HistoryTime>& to,
                    const Progress& progress) {
    std::size_t done = 0;
    for (const SegmentInfo& segment : reader_.segments()) {
      if (!is_beside(clock_, segment, from, to)) take(segment, from, to);
      ++done;
      if (progress) {
        progress(static_cast<double>(done) / static_cast<double>(reader_.segments().size()));
      }
    }
    out_ << text_;
    return std::move(summary_);
  }

 private:
  void take(const SegmentInfo& segment, const std::optional<HistoryTime>& from,
            const std::optional<HistoryTime>& to) {
    try {
      SegmentExport walk(reader_, segment, setups_.of(segment), places_.at(segment.setup),
                         summary_.damage);
      std::uint64_t cycle = 0;
      while (walk.next(cycle)) {
        tell_damage();
        const double time_s = clock_.seconds_at(segment, cycle);
        if (from && is_before(time_s, walk.wall_ns(cycle), *from)) continue;
        if (to && !is_before(time_s, walk.wall_ns(cycle), *to)) continue;
        write(segment, time_s, walk);
      }
    } catch (const std::exception& error) {
      summary_.damage.push_back({segment.id, error.what()});
    }
    tell_damage();
  }

  void write(const SegmentInfo& segment, double time_s, SegmentExport& walk) {
    if (!first_s_) first_s_ = time_s;
    std::fill(row_.begin(), row_.end(), not_a_number);
    walk.fill(row_);
    row_[0] = time_s - *first_s_;
    if (last_written_ != nullptr && last_written_ != &segment) {
      const std::string gap = gap_line(clock_, *last_written_, segment, *first_s_);
      text_ += gap;
      if (!gap.empty()) ++summary_.gaps;
    }
    last_written_ = &segment;
    append_row(text_, row_);
    out_ << text_;
    text_.clear();
    ++summary_.rows;
  }

  void tell_damage() {
    for (; told_ < summary_.damage.size(); ++told_) text_ += damage_line(summary_.damage[told_]);
  }

  const HistoryReader& reader_;
  ParsedSetups setups_;
  HistoryClock clock_;
  std::ostream& out_;
  RunColumns columns_;
  std::map<std::int64_t, SetupColumns> places_;
  ExportSummary summary_;
  std::size_t told_{0};  ///< of its damage
  std::string text_;
  std::vector<double> row_;
  std::optional<double> first_s_;
  const SegmentInfo* last_written_{nullptr};
};

}  // namespace

ExportSummary export_run(const std::filesystem::path& history,
                         const std::optional<HistoryTime>& from,
                         const std::optional<HistoryTime>& to, std::ostream& out,
                         const Progress& progress, const SetupParser& parser) {
  const HistoryReader reader(history);
  return RunExport(reader, parser, out).run(from, to, progress);
}

}  // namespace thermocomp
