#include "cli/report/machine_week.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <limits>
#include <utility>

#include <Eigen/Core>
#include <Eigen/LU>

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

WallSpan span_of(const SegmentInfo& segment) {
  const auto begin_ns = static_cast<double>(segment.wall_ns);
  const double cycles =
      static_cast<double>(segment.last_cycle + 1) - static_cast<double>(segment.first_cycle);
  const double length_ns = cycles * static_cast<double>(segment.grid.period.count());
  return {s_per_ns * begin_ns, s_per_ns * (begin_ns + length_ns)};
}

std::vector<WallSpan> recorded_spans(const std::vector<SegmentInfo>& segments) {
  std::vector<WallSpan> spans;
  spans.reserve(segments.size());
  for (const SegmentInfo& segment : segments) spans.push_back(span_of(segment));
  return spans;
}

/// In order; overlapping and contiguous ones are merged.
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

/// Usable setup in force at a given time: that of the last segment that began before it.
const ReplaySetup* in_force(double moment_s, const std::vector<SegmentInfo>& segments,
                            const ParsedSetups& setups) {
  const ReplaySetup* setup = nullptr;
  for (const SegmentInfo& segment : segments) {
    if (span_of(segment).from_s > moment_s && setup != nullptr) break;
    if (const ReplaySetup* found = setups.find(segment)) setup = found;
  }
  return setup;
}

/// Spans of segments with such a setup.
std::vector<WallSpan> spans_of(const std::vector<SegmentInfo>& segments, const ParsedSetups& setups,
                               const std::function<bool(const ReplaySetup&)>& is_such,
                               const WallSpan& span) {
  std::vector<WallSpan> spans;
  for (const SegmentInfo& segment : segments) {
    const ReplaySetup* setup = setups.find(segment);
    const WallSpan one = span_of(segment).within(span);
    if (setup != nullptr && is_such(*setup) && one.length_s() > 0.0) spans.push_back(one);
  }
  return merged(std::move(spans));
}

const AxisConfig* axis_named(const ReplaySetup& setup, const std::string& name) {
  for (const AxisConfig& axis : setup.estimator.axes)
    if (axis.name == name) return &axis;
  return nullptr;
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
  const AxisConfig* axis = axis_named(setup, prove.subject.name);
  if (axis == nullptr || course.time_s.size() < 2) return;
  const double half_s = 0.5 * (course.time_s[1] - course.time_s[0]);
  const double moves_s = 2.0 * std::abs(prove.value) / axis->limiter.rate_um_per_s_max +
                         setup.estimator.compensation.prove_hold_s;
  for (ThinnedColumn& column : course.columns)
    for (std::size_t i = 0; i < column.values.size(); ++i)
      if (column.name == axis->name + "_offset_um" && course.time_s[i] > prove.wall_s - half_s &&
          course.time_s[i] < prove.wall_s + moves_s + half_s)
        column.values[i] = not_a_number;
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
  return offsets == nullptr || offsets->empty() ? not_a_number : offsets->front();
}

ProbingWeek probing_of(const std::filesystem::path& history, const ReplaySetup& setup,
                       double moment_s, const std::string& axis, double value_um,
                       const SetupParser& parser) {
  ProbingWeek probing{moment_s, axis, not_a_number, value_um, setup.dry_run};
  const AxisConfig* of = axis_named(setup, axis);
  if (of == nullptr) return probing;
  probing.offset_um = offset_at(history, moment_s, axis, parser);
  // A total measured value (always total in a dry run) includes the compensated displacement.
  if (setup.estimator.correction.measured == MeasuredMeaning::total || setup.dry_run)
    probing.left_um = value_um + probing.offset_um * of->sign;
  return probing;
}

/// The rows in which every column has a value, less the columns' means; none if they are too few
/// for a correlation or drift.
Eigen::MatrixXd centred(std::initializer_list<const std::vector<double>*> columns) {
  const std::size_t rows = (*columns.begin())->size();
  Eigen::MatrixXd table(rows, columns.size());
  Eigen::Index kept = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    Eigen::Index column = 0;
    for (const std::vector<double>* values : columns) table(kept, column++) = (*values)[row];
    if (table.row(kept).allFinite()) ++kept;
  }
  constexpr Eigen::Index rows_min = 30;
  if (kept < rows_min) return {};
  table.conservativeResize(kept, Eigen::NoChange);
  const Eigen::RowVectorXd mean = table.colwise().mean();
  return table.rowwise() - mean;
}

struct Line {
  double slope{0.0};
  double slope_sd{not_a_number};
};

/// Drift of sensor minus neighbour over the whole stretch: least squares on constant, neighbour and
/// time. The standard error counts six hours as one independent sample.
Line drift_of(const std::vector<double>& time_s, const std::vector<double>& sensor,
              const std::vector<double>& neighbour) {
  const Eigen::MatrixXd rows = centred({&neighbour, &time_s, &sensor});
  if (rows.rows() == 0) return {};
  const double length_s = time_s.back() - time_s.front();
  Eigen::MatrixX2d design = rows.leftCols<2>();
  design.col(1) /= length_s;
  const Eigen::VectorXd difference = rows.col(2) - rows.col(0);
  const Eigen::Matrix2d normal = design.transpose() * design;
  if (!(normal.determinant() > 1e-9 * normal(0, 0) * normal(1, 1))) return {};
  const Eigen::Matrix2d inverse = normal.inverse();
  const Eigen::Vector2d fit = inverse * (design.transpose() * difference);
  constexpr double independent_s = 6.0 * 3600.0;
  const double independent = std::max(1.0, length_s / independent_s);
  const double squares = (difference - design * fit).squaredNorm();
  return {fit(1), std::sqrt(squares / independent * inverse(1, 1))};
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const Eigen::MatrixXd rows = centred({&a, &b});
  if (rows.rows() == 0) return 0.0;
  constexpr double still_K2 = 1e-12;  // of a constant, what rounding leaves
  const double norms = rows.col(0).norm() * rows.col(1).norm();
  const bool both_vary = norms > still_K2 * static_cast<double>(rows.rows());
  return both_vary ? rows.col(0).dot(rows.col(1)) / norms : 0.0;
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
    for (std::size_t j = i + 1; j < list.size() && list[j].run == list[i].run && !ended; ++j) {
      ended = list[j].subject == list[i].subject;
      if (ended) until_s = list[j].wall_s;  // recovery or next fault of the subject
    }
    const WallSpan within = WallSpan{list[i].wall_s, until_s}.within(span);
    if (!(within.to_s >= within.from_s)) continue;
    Outages& outages = found[list[i].subject];
    outages.subject = list[i].subject;
    outages.last = list[i];
    for (OutageTimes* times : {static_cast<OutageTimes*>(&outages), &outages.kinds[list[i].code]}) {
      ++times->count;
      times->lasted_s += within.length_s();
      times->lasts = !ended && until_s >= span.to_s - 1.0;
    }
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
  const ParsedSetups setups(reader, parser);
  for (const SegmentInfo& segment : reader.segments()) {
    events.run_ends_s[segment.run] = span_of(segment).to_s;  // end of its last segment
    if (const auto failure = setups.failures().find(segment.setup);
        failure != setups.failures().end())
      week.damage.push_back({segment.id, failure->second});
  }
  const auto setup_at = [&](double moment_s) {
    return in_force(moment_s, reader.segments(), setups);
  };
  const auto points = static_cast<std::size_t>(
      std::clamp(span.length_s() / point_s_min, 60.0, static_cast<double>(points_max)));
  week.course = thin_history(history, span.from_s, span.to_s, points, ThinningLimits{}, parser);
  week.modes = daemon_pauses(events, recorded_spans(reader.segments()), span);
  week.recorded_s = span.length_s();
  for (const ModeSpell& pause : week.modes) week.recorded_s -= pause.span.length_s();
  const auto has_zero_model = [](const ReplaySetup& setup) {
    return !has_gain(setup.model) && !setup.estimator.correction.learns_bias();
  };
  add_modes(week, mode_spells(events, span), merged(recorded_spans(reader.segments())),
            spans_of(reader.segments(), setups, has_zero_model, span));
  week.outages = outages_of(events, span);
  week.sensors = sensors_of(week.course);
  const auto is_dry_run = [](const ReplaySetup& setup) { return setup.dry_run; };
  week.sent = spans_of(reader.segments(), setups, std::not_fn(is_dry_run), span);
  week.dry_runs = spans_of(reader.segments(), setups, is_dry_run, span);
  for (const RecordedEvent& event : events.events)
    if (event.kind == EventKind::command && event.code == to_string(CommandKind::prove))
      if (const ReplaySetup* setup = setup_at(event.wall_s)) leave_out(event, *setup, week.course);
  if (const ReplaySetup* setup = setup_at(span.to_s)) {
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
    const ReplaySetup* setup = setup_at(event.wall_s);
    if (event.candidate) {
      week.candidate = event.candidate;
      scored = setup;
    }
    if (setup != nullptr && event.code == to_string(CommandKind::measured))
      week.probings.push_back(
          probing_of(history, *setup, event.wall_s, event.subject.name, event.value, parser));
  }
  // The score of a model other than the present one, as before a promotion, is outdated.
  const ReplaySetup* last = setup_at(span.to_s);
  if (scored != nullptr && last != nullptr && !predict_the_same(scored->model, last->model))
    week.candidate.reset();
  return week;
}

}  // namespace thermocomp::cli
