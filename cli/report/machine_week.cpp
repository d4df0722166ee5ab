#include "cli/report/machine_week.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>

#include "daemon/history/replay/segment_walk.hpp"

namespace thermocomp::cli {
namespace {

constexpr double s_per_ns = 1e-9;
constexpr std::size_t points_max = 4000;
constexpr double point_s_min = 10.0;
/// Share of the bound from which an offset counts as at the bound.
constexpr double at_bound_share = 0.995;
/// Averaging window about a probing; an offset changes by less than 1 um in it.
constexpr double probing_half_s = 2.0;
/// Longest gap between contiguous segments.
constexpr double apart_s = 1.0;

double end_s(const SegmentInfo& segment) {
  const double cycles =
      static_cast<double>(segment.last_cycle + 1) - static_cast<double>(segment.first_cycle);
  return s_per_ns * (static_cast<double>(segment.wall_ns) +
                     cycles * static_cast<double>(segment.grid.period.count()));
}

std::vector<WallSpan> recorded_spans(const std::vector<SegmentInfo>& segments) {
  std::vector<WallSpan> spans;
  spans.reserve(segments.size());
  for (const SegmentInfo& segment : segments)
    spans.push_back({s_per_ns * static_cast<double>(segment.wall_ns), end_s(segment)});
  return spans;
}

/// Merges spans separated by time without a daemon, or by time skipped when the clock was set.
std::vector<WallSpan> merged(std::vector<WallSpan> spans) {
  std::sort(spans.begin(), spans.end(),
            [](const WallSpan& a, const WallSpan& b) { return a.from_s < b.from_s; });
  std::vector<WallSpan> joined;
  for (const WallSpan& span : spans) {
    if (!joined.empty() && span.from_s - joined.back().to_s < apart_s)
      joined.back().to_s = std::max(joined.back().to_s, span.to_s);
    else
      joined.push_back(span);
  }
  return joined;
}

const std::vector<double>* column_of(const ThinnedHistory& course, const std::string& name) {
  for (const ThinnedColumn& column : course.columns)
    if (column.name == name) return &column.values;
  return nullptr;
}

/// Setup in force at a given time: that of the last segment that began before it.
class Setups {
 public:
  Setups(const HistoryReader& reader, const SetupParser& parser, std::vector<HistoryDamage>& damage)
      : segments_(reader.segments()) {
    for (const SegmentInfo& segment : segments_) {
      if (setups_.contains(segment.setup)) continue;
      try {
        setups_.emplace(segment.setup, parser(reader.setup(segment)));
      } catch (const std::exception& error) {
        damage.push_back({segment.id, error.what()});
      }
    }
  }

  [[nodiscard]] const ReplaySetup* of(const SegmentInfo& segment) const {
    const auto found = setups_.find(segment.setup);
    return found == setups_.end() ? nullptr : &found->second;
  }

  [[nodiscard]] const ReplaySetup* at(double moment_s) const {
    const ReplaySetup* setup = nullptr;
    for (const SegmentInfo& segment : segments_) {
      if (s_per_ns * static_cast<double>(segment.wall_ns) > moment_s && setup != nullptr) break;
      if (const ReplaySetup* found = of(segment)) setup = found;
    }
    return setup;
  }

 private:
  const std::vector<SegmentInfo>& segments_;
  std::map<std::int64_t, ReplaySetup> setups_;
};

/// Spans of segments with such a setup; contiguous segments are merged.
std::vector<WallSpan> spans_of(const std::vector<SegmentInfo>& segments, const Setups& setups,
                               const std::function<bool(const ReplaySetup&)>& is_such,
                               const WallSpan& span) {
  std::vector<WallSpan> spans;
  for (const SegmentInfo& segment : segments) {
    const ReplaySetup* setup = setups.of(segment);
    if (setup == nullptr || !is_such(*setup)) continue;
    const WallSpan one =
        WallSpan{s_per_ns * static_cast<double>(segment.wall_ns), end_s(segment)}.within(span);
    if (!(one.length_s() > 0.0)) continue;
    if (!spans.empty() && std::abs(one.from_s - spans.back().to_s) < apart_s)
      spans.back().to_s = one.to_s;
    else
      spans.push_back(one);
  }
  return spans;
}

/// Adds the spells while something was recorded, with `zero_model` where it applies.
void add_modes(MachineWeek& week, const std::vector<ModeSpell>& spells,
               const std::vector<WallSpan>& recorded, const std::vector<WallSpan>& zeros) {
  for (const ModeSpell& spell : spells)
    for (const WallSpan& there : recorded) {
      WallSpan rest = spell.span.within(there);
      const bool compensates = spell.mode == to_string(Mode::compensating);
      for (std::size_t i = 0; compensates && i < zeros.size(); ++i) {
        const WallSpan still = rest.within(zeros[i]);
        if (!(still.length_s() > 0.0)) continue;
        if (still.from_s > rest.from_s)
          week.modes.push_back({{rest.from_s, still.from_s}, spell.mode});
        week.modes.push_back({still, zero_model});
        rest.from_s = still.to_s;
      }
      if (rest.length_s() > 0.0) week.modes.push_back({rest, spell.mode});
    }
}

/// Blanks the offsets during a proving move, which compensates nothing.
void leave_out(const RecordedEvent& prove, const ReplaySetup& setup, ThinnedHistory& course) {
  const auto& axes = setup.estimator.axes;
  const auto axis = std::find_if(axes.begin(), axes.end(), [&](const AxisConfig& each) {
    return each.name == prove.subject.name;
  });
  if (axis == axes.end() || course.time_s.size() < 2) return;
  const double half_s = 0.5 * (course.time_s[1] - course.time_s[0]);
  const double moves_s = 2.0 * std::abs(prove.value) / axis->limiter.rate_um_per_s_max +
                         setup.estimator.compensation.prove_hold_s;
  for (ThinnedColumn& column : course.columns)
    for (std::size_t i = 0; i < column.values.size(); ++i)
      if (column.name == axis->name + "_offset_um" && course.time_s[i] > prove.wall_s - half_s &&
          course.time_s[i] < prove.wall_s + moves_s + half_s)
        column.values[i] = std::nan("");
}

/// Range over the points with the given place.
OffsetRange range_of(const std::vector<double>& offsets, const std::vector<PointPlace>& places,
                     PointPlace place, double bound_um) {
  OffsetRange range;
  double count = 0.0;
  double sizes = 0.0;
  double bound = 0.0;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    if (places[i] != place || !std::isfinite(offsets[i])) continue;
    range.low_um = std::fmin(range.low_um, offsets[i]);
    range.high_um = std::fmax(range.high_um, offsets[i]);
    sizes += std::abs(offsets[i]);
    count += 1.0;
    if (std::abs(offsets[i]) >= at_bound_share * bound_um) bound += 1.0;
  }
  if (count > 0.0) {
    range.mean_size_um = sizes / count;
    range.at_bound_share = bound / count;
  }
  return range;
}

AxisWeek axis_week(const AxisConfig& axis, const ThinnedHistory& course,
                   const std::vector<PointPlace>& places) {
  AxisWeek week;
  week.name = axis.name;
  week.unit = axis.output.ends_with("_urad") ? "urad" : "um";
  week.bound_um = axis.limiter.offset_um_max;
  const auto* offsets = column_of(course, axis.name + "_offset_um");
  if (offsets == nullptr) return week;
  week.sent = range_of(*offsets, places, PointPlace::sent, week.bound_um);
  week.dry_run = range_of(*offsets, places, PointPlace::dry_run, week.bound_um);
  return week;
}

double offset_at(const std::filesystem::path& history, double moment_s, const std::string& axis,
                 const SetupParser& parser) {
  const ThinnedHistory there = thin_history(history, moment_s - probing_half_s,
                                            moment_s + probing_half_s, 1, ThinningLimits{}, parser);
  const auto* offsets = column_of(there, axis + "_offset_um");
  return offsets == nullptr || offsets->empty() ? std::nan("") : offsets->front();
}

ProbingWeek probing_of(const std::filesystem::path& history, const ReplaySetup& setup,
                       double moment_s, const std::string& axis, double value_um,
                       const SetupParser& parser) {
  ProbingWeek probing{moment_s, axis, std::nan(""), value_um, setup.dry_run};
  const auto& axes = setup.estimator.axes;
  const auto of = std::find_if(axes.begin(), axes.end(),
                               [&](const AxisConfig& one) { return one.name == axis; });
  if (of == axes.end()) return probing;
  probing.offset_um = offset_at(history, moment_s, axis, parser);
  // A total measured value (always total in a dry run) includes the compensated displacement.
  if (setup.estimator.correction.measured == MeasuredMeaning::total || setup.dry_run)
    probing.left_um = value_um + probing.offset_um * of->sign;
  return probing;
}

struct Line {
  double slope{0.0};
  double slope_sd{0.0};
};

/// Drift of sensor minus neighbour over the whole stretch: least squares on constant, neighbour and
/// time. The standard error counts six hours as one independent sample.
Line drift_of(const std::vector<double>& time_s, const std::vector<double>& sensor,
              const std::vector<double>& neighbour) {
  double sums[3][4] = {};
  double count = 0.0;
  double mean_n = 0.0;
  double mean_t = 0.0;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!std::isfinite(sensor[i] + neighbour[i])) continue;
    mean_n += neighbour[i];
    mean_t += time_s[i];
    count += 1.0;
  }
  if (count < 30.0) return {0.0, std::nan("")};
  mean_n /= count;
  mean_t /= count;
  const double length_s = time_s.back() - time_s.front();
  std::vector<std::array<double, 4>> rows;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!std::isfinite(sensor[i] + neighbour[i])) continue;
    rows.push_back(
        {1.0, neighbour[i] - mean_n, (time_s[i] - mean_t) / length_s, sensor[i] - neighbour[i]});
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 4; ++b) sums[a][b] += rows.back()[a] * rows.back()[b];
  }
  // Neighbour and time are centred, so the constant decouples.
  const double determinant = sums[1][1] * sums[2][2] - sums[1][2] * sums[1][2];
  if (!(determinant > 1e-9 * sums[1][1] * sums[2][2])) return {0.0, std::nan("")};
  const double gain = (sums[1][3] * sums[2][2] - sums[2][3] * sums[1][2]) / determinant;
  const double slope = (sums[2][3] * sums[1][1] - sums[1][3] * sums[1][2]) / determinant;
  const double constant = sums[0][3] / count;
  double squares = 0.0;
  for (const auto& row : rows)
    squares += std::pow(row[3] - constant - gain * row[1] - slope * row[2], 2);
  constexpr double independent_s = 6.0 * 3600.0;
  const double independent = std::max(1.0, length_s / independent_s);
  const double variance = squares / count;
  return {slope, std::sqrt(variance * count / independent * sums[1][1] / determinant)};
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double n = 0.0;
  double sums[5] = {};
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i] + b[i])) continue;
    const double x = a[i] - 20.0;
    const double y = b[i] - 20.0;
    n += 1.0;
    sums[0] += x;
    sums[1] += y;
    sums[2] += x * x;
    sums[3] += y * y;
    sums[4] += x * y;
  }
  if (n < 30.0) return 0.0;
  const double xx = sums[2] / n - sums[0] * sums[0] / n / n;
  const double yy = sums[3] / n - sums[1] * sums[1] / n / n;
  const double xy = sums[4] / n - sums[0] * sums[1] / n / n;
  return xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;
}

std::size_t recorded_points(const ThinnedHistory& course) {
  std::size_t points = 0;
  for (std::size_t i = 0; i < course.time_s.size(); ++i)
    for (const ThinnedColumn& column : course.columns)
      if (std::isfinite(column.values[i])) {
        ++points;
        break;
      }
  return points;
}

}  // namespace

WallSpan WallSpan::within(const WallSpan& other) const noexcept {
  return {std::max(from_s, other.from_s), std::min(to_s, other.to_s)};
}

double MachineWeek::dry_run_s() const {
  double sum = 0.0;
  for (const WallSpan& one : dry_runs) sum += one.length_s();
  return sum;
}

double MachineWeek::mode_s(const std::string& mode) const {
  double sum = 0.0;
  for (const ModeSpell& spell : modes)
    if (spell.mode == mode) sum += spell.span.length_s();
  return sum;
}

std::vector<ModeSpell> mode_spells(const WeekEvents& events, const WallSpan& span) {
  std::vector<ModeSpell> spells;
  const auto& list = events.events;
  RecordedMode mode;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (i > 0 && list[i].run != list[i - 1].run) mode = {};
    mode.take(list[i]);
    const bool is_last = i + 1 == list.size() || list[i + 1].run != list[i].run;
    const auto end = events.run_ends_s.find(list[i].run);
    const double run_end_s = end == events.run_ends_s.end() ? span.to_s : end->second;
    const WallSpan within =
        WallSpan{list[i].wall_s, is_last ? run_end_s : list[i + 1].wall_s}.within(span);
    if (mode.name().empty() || !(within.length_s() > 0.0)) continue;
    if (!spells.empty() && spells.back().mode == mode.name() &&
        spells.back().span.to_s == within.from_s)
      spells.back().span.to_s = within.to_s;
    else
      spells.push_back({within, mode.name()});
  }
  return spells;
}

std::vector<ModeSpell> daemon_pauses(const WeekEvents& events, std::vector<WallSpan> recorded,
                                     const WallSpan& span) {
  std::sort(recorded.begin(), recorded.end(),
            [](const WallSpan& a, const WallSpan& b) { return a.from_s < b.from_s; });
  recorded.push_back({span.to_s + apart_s, span.to_s + apart_s});
  std::vector<ModeSpell> pauses;
  double until_s = span.from_s - apart_s;
  double last_s = -std::numeric_limits<double>::infinity();  // end of the records so far
  for (const WallSpan& one : recorded) {
    const WallSpan pause = WallSpan{until_s, one.from_s}.within(span);
    if (one.from_s - until_s > apart_s && pause.length_s() > 0.0) {
      bool asked = false;
      for (const RecordedEvent& event : events.events)
        if (event.kind == EventKind::daemon && event.wall_s < until_s + apart_s)
          asked = event.code == "stopping" || (asked && event.code != "started");
      const bool runs_on =
          std::isfinite(last_s) &&
          std::none_of(events.run_ends_s.begin(), events.run_ends_s.end(),
                       [&](const auto& end) {
                         return end.second > last_s - apart_s && end.second < one.from_s;
                       }) &&
          std::none_of(events.events.begin(), events.events.end(), [&](const Event& event) {
            return event.kind == EventKind::daemon && event.code == "started" &&
                   event.wall_s > last_s - apart_s && event.wall_s < one.from_s + apart_s;
          });
      pauses.push_back({pause, runs_on ? not_recorded : asked ? daemon_stopped : daemon_ended});
    }
    until_s = std::max(until_s, one.to_s);
    last_s = std::max(last_s, one.to_s);
  }
  return pauses;
}

std::vector<Outages> outages_of(const WeekEvents& events, const WallSpan& span) {
  std::map<Subject, Outages> found;
  const auto& list = events.events;
  std::int64_t stopping = -1;  // run that is being stopped
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (list[i].kind == EventKind::daemon && list[i].code == "stopping") stopping = list[i].run;
    if (list[i].kind != EventKind::fault || list[i].run == stopping) continue;
    const auto end = events.run_ends_s.find(list[i].run);
    double until_s = end == events.run_ends_s.end() ? span.to_s : end->second;
    bool ended = false;
    for (std::size_t j = i + 1; j < list.size(); ++j) {
      if (list[j].run != list[i].run) break;
      if (list[j].subject != list[i].subject) continue;
      until_s = list[j].wall_s;  // recovery or next fault of the subject
      ended = true;
      break;
    }
    const WallSpan within = WallSpan{list[i].wall_s, until_s}.within(span);
    if (!(within.to_s >= within.from_s)) continue;
    Outages& outages = found[list[i].subject];
    outages.subject = list[i].subject;
    outages.last = list[i];
    ++outages.count;
    outages.lasted_s += within.length_s();
    outages.lasts = !ended && until_s >= span.to_s - 1.0;
    Outages::Kind& kind = outages.kinds[list[i].code];
    ++kind.count;
    kind.lasted_s += within.length_s();
    kind.lasts = outages.lasts;
  }
  std::vector<Outages> sorted;
  sorted.reserve(found.size());
  for (auto& [subject, outages] : found) sorted.push_back(std::move(outages));
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Outages& a, const Outages& b) { return a.lasted_s > b.lasted_s; });
  return sorted;
}

std::vector<SensorWeek> sensors_of(const ThinnedHistory& course) {
  constexpr double alike_min = 0.8;
  std::vector<SensorWeek> sensors;
  const auto points = static_cast<double>(recorded_points(course));
  for (const ThinnedColumn& column : course.columns) {
    if (!column.name.ends_with("_degC")) continue;
    SensorWeek sensor;
    sensor.name = column.name.substr(0, column.name.size() - 5);
    double there = 0.0;
    for (const double value : column.values) {
      if (!std::isfinite(value)) continue;
      sensor.low_degC = std::fmin(sensor.low_degC, value);
      sensor.high_degC = std::fmax(sensor.high_degC, value);
      there += 1.0;
    }
    sensor.missing_share = points > 0.0 ? 1.0 - there / points : 0.0;
    double best = alike_min;
    for (const ThinnedColumn& other : course.columns) {
      if (&other == &column || !other.name.ends_with("_degC")) continue;
      const double alike = correlation(column.values, other.values);
      if (!(alike > best)) continue;
      best = alike;
      sensor.neighbour = other.name.substr(0, other.name.size() - 5);
      constexpr double day_s = 86400.0;  // distinguishes the daily cycle from a drift
      if (course.time_s.back() - course.time_s.front() < day_s) continue;
      const Line drift = drift_of(course.time_s, column.values, other.values);
      sensor.drift_K = drift.slope;
      sensor.drift_sd_K = drift.slope_sd;
    }
    sensors.push_back(std::move(sensor));
  }
  return sensors;
}

std::vector<PointPlace> places_of(const ThinnedHistory& course, const std::vector<WallSpan>& sent,
                                  const std::vector<WallSpan>& dry_runs) {
  const std::vector<double>& time_s = course.time_s;
  const double half_s = time_s.size() > 1 ? 0.5 * (time_s[1] - time_s[0]) : 0.0;
  const auto touches = [half_s](double middle_s, const std::vector<WallSpan>& spans) {
    return std::any_of(spans.begin(), spans.end(), [&](const WallSpan& span) {
      return span.overlaps({middle_s - half_s, middle_s + half_s});
    });
  };
  std::vector<PointPlace> places;
  for (const double middle_s : time_s) {
    if (!touches(middle_s, dry_runs))
      places.push_back(PointPlace::sent);
    else
      places.push_back(touches(middle_s, sent) ? PointPlace::both : PointPlace::dry_run);
  }
  return places;
}

WallSpan recorded_span(const std::filesystem::path& history) {
  const HistoryReader reader(history);
  WallSpan span{1e300, -1e300};
  for (const WallSpan& one : recorded_spans(reader.segments())) {
    span.from_s = std::min(span.from_s, one.from_s);
    span.to_s = std::max(span.to_s, one.to_s);
  }
  if (!(span.to_s > span.from_s)) throw HistoryError(history.string() + ": nothing is recorded");
  return span;
}

MachineWeek machine_week(const std::filesystem::path& history, const WallSpan& span,
                         const SetupParser& parser) {
  const HistoryReader reader(history);
  MachineWeek week;
  week.history = history.string();
  week.span = span;
  week.damage = reader.damage();
  WeekEvents events{read_events(history), {}};
  for (const SegmentInfo& segment : reader.segments()) {
    events.run_ends_s[segment.run] = end_s(segment);  // end of its last segment
  }
  const auto points = static_cast<std::size_t>(
      std::clamp(span.length_s() / point_s_min, 60.0, static_cast<double>(points_max)));
  week.course = thin_history(history, span.from_s, span.to_s, points, ThinningLimits{}, parser);
  week.modes = daemon_pauses(events, recorded_spans(reader.segments()), span);
  week.recorded_s = span.length_s();
  for (const ModeSpell& pause : week.modes) week.recorded_s -= pause.span.length_s();
  const Setups setups(reader, parser, week.damage);
  add_modes(week, mode_spells(events, span), merged(recorded_spans(reader.segments())),
            merged(spans_of(
                reader.segments(), setups,
                [](const ReplaySetup& setup) {
                  return !has_gain(setup.model) && !setup.estimator.correction.learns_bias();
                },
                span)));
  week.outages = outages_of(events, span);
  week.sensors = sensors_of(week.course);
  const auto is_dry_run = [](const ReplaySetup& setup) { return setup.dry_run; };
  week.sent = spans_of(reader.segments(), setups, std::not_fn(is_dry_run), span);
  week.dry_runs = spans_of(reader.segments(), setups, is_dry_run, span);
  for (const RecordedEvent& event : events.events)
    if (event.kind == EventKind::command && event.code == to_string(CommandKind::prove))
      if (const ReplaySetup* setup = setups.at(event.wall_s)) leave_out(event, *setup, week.course);
  if (const ReplaySetup* setup = setups.at(span.to_s)) {
    week.dry_run = setup->dry_run;
    const std::vector<PointPlace> places = places_of(week.course, week.sent, week.dry_runs);
    for (const AxisConfig& axis : setup->estimator.axes)
      week.axes.push_back(axis_week(axis, week.course, places));
  }
  const ReplaySetup* scored = nullptr;  // with the newest score of a candidate
  for (const RecordedEvent& event : events.events) {
    if (event.wall_s < span.from_s || event.wall_s >= span.to_s) continue;
    if (event.kind == EventKind::daemon && event.code == "started") ++week.starts;
    if (event.kind != EventKind::command) continue;
    week.commands.push_back(event);
    const ReplaySetup* setup = setups.at(event.wall_s);
    if (event.candidate) {
      week.candidate = event.candidate;
      scored = setup;
    }
    if (setup != nullptr && event.code == to_string(CommandKind::measured))
      week.probings.push_back(
          probing_of(history, *setup, event.wall_s, event.subject.name, event.value, parser));
  }
  // The score of a model other than the present one, as before a promotion, is outdated.
  const ReplaySetup* last = setups.at(span.to_s);
  if (scored != nullptr && last != nullptr && !predict_the_same(scored->model, last->model))
    week.candidate.reset();
  return week;
}

}  // namespace thermocomp::cli
