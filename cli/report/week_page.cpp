#include "cli/report/week_page.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <deque>
#include <iomanip>
#include <sstream>
#include <string_view>
#include <utility>

#include "cli/observe/status_text.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

constexpr const char* in_the_week = "%a %d, %H:%M";

std::string local_text(double wall_s, const char* form = "%Y-%m-%d %H:%M") {
  const auto seconds = static_cast<std::time_t>(wall_s);
  std::tm parts{};
  localtime_r(&seconds, &parts);
  std::ostringstream text;
  text << std::put_time(&parts, form);
  return text.str();
}

std::string mode_words(const std::string& name) {
  if (name == not_recorded)
    return "nothing was recorded within a run of the daemon (disk full, clock set)";
  if (name == daemon_stopped) return "the daemon was stopped";
  if (name == daemon_ended)
    return "nothing was recorded, and no daemon was stopped (power cut, crash, disk full)";
  if (name == zero_model) return "nothing to compensate: every coefficient of the model is 0";
  if (name == not_driven) return "an axis was latched, hence not driven: see its events";
  const auto mode = mode_named(name);
  return mode ? std::string(code_text(*mode, name == "dry_run").meaning) : name;
}

std::string unit_words(const std::string& unit) {
  return unit == "urad" ? "µrad" : "µm";
}

std::string summary(const MachineWeek& week) {
  const double on_s = week.mode_s("compensating");
  std::string text = "From " + local_text(week.span.from_s) + " to " + local_text(week.span.to_s) +
                     " (" + duration_text(week.span.length_s()) +
                     ") the machine was compensated for " + duration_text(on_s) + ".";
  if (week.dry_run_s() > 0.0)
    text += " " + duration_text(week.dry_run_s()) +
            " were a dry run: everything was computed and recorded, and nothing was sent to the "
            "machine.";
  return text;
}

/// The rows add up to the total in whole seconds and tenths of a percent.
std::string time_table(const MachineWeek& week) {
  constexpr double tenths = 1000.0;
  const double whole_s = std::floor(week.span.length_s());
  std::vector<std::vector<std::string>> rows{{"mode", "time", "of the whole"}};
  double rest_s = whole_s;
  double rest = tenths;
  const auto add = [&](const std::string& what, double seconds, double share) {
    if (seconds < 1.0 && share < 1.0) return;
    rest_s -= seconds;
    rest -= share;
    rows.push_back({what, duration_text(seconds), fixed(0.1 * share, 1) + " %"});
  };
  for (const char* mode :
       {"compensating", zero_model, not_driven.data(), "holding", "ramping_to_zero", "disabled",
        "starting", "dry_run", not_recorded, daemon_stopped, daemon_ended}) {
    const double seconds = week.mode_s(mode);
    add(mode_words(mode), std::floor(seconds), std::floor(tenths * seconds / whole_s));
  }
  add("unknown mode, and rounding", rest_s, rest);
  rows.push_back({"the whole", duration_text(whole_s), "100 %"});
  return html_table(rows);
}

/// The longest periods; the rest is summed in one row.
std::string spells_part(const MachineWeek& week) {
  constexpr std::size_t listed_max = 12;
  std::vector<ModeSpell> spells;
  for (const ModeSpell& spell : week.modes)
    if (spell.mode != "compensating") spells.push_back(spell);
  std::sort(spells.begin(), spells.end(), [](const ModeSpell& a, const ModeSpell& b) {
    return a.span.length_s() > b.span.length_s();
  });
  const std::size_t listed = std::min(listed_max, spells.size());
  double shorter_s = 0.0;
  for (std::size_t i = listed; i < spells.size(); ++i) shorter_s += spells[i].span.length_s();
  const std::size_t shorter = spells.size() - listed;
  spells.resize(listed);
  std::sort(spells.begin(), spells.end(),
            [](const ModeSpell& a, const ModeSpell& b) { return a.span.from_s < b.span.from_s; });
  std::vector<std::vector<std::string>> rows{{"not compensating", "from", "for"}};
  for (const ModeSpell& spell : spells)
    rows.push_back({mode_words(spell.mode), local_text(spell.span.from_s, in_the_week),
                    duration_text(spell.span.length_s())});
  if (shorter > 0)
    rows.push_back({std::to_string(shorter) + " shorter ones", "", duration_text(shorter_s)});
  return html_table(rows);
}

std::string why_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"why it did less than it could", "times", "in all"}};
  for (const Outages& outages : week.outages)
    // A suspicion is reported with its sensor and has no effect by itself.
    if (const auto reason = reason_named(outages.last.code);
        outages.subject.kind == SubjectKind::reason && reason && reason != Reason::sensor_suspected)
      rows.push_back({std::string(code_text(*reason).meaning), std::to_string(outages.count),
                      duration_text(outages.lasted_s)});
  return html_table(rows);
}

std::string ranges_table(const MachineWeek& week, const std::string& what,
                         OffsetRange AxisWeek::*range) {
  std::vector<std::vector<std::string>> rows{
      {what, "from", "to", "mean size", "bound", "at the bound"}};
  for (const AxisWeek& axis : week.axes) {
    const OffsetRange& of = axis.*range;
    if (of.is_there())
      rows.push_back({axis.name + ", " + unit_words(axis.unit), figure_text(of.low_um),
                      figure_text(of.high_um), figure_text(of.mean_size_um),
                      figure_text(axis.bound_um), figure_text(100.0 * of.at_bound_share) + " %"});
  }
  return html_table(rows);
}

std::string axes_part(const MachineWeek& week) {
  std::string html = ranges_table(week, "offset sent", &AxisWeek::sent);
  if (html.empty()) html = html_paragraph("Nothing was sent.");
  const std::string dry =
      ranges_table(week, "computed in the dry run, not sent", &AxisWeek::dry_run);
  return dry.empty() ? html : html + dry;
}

std::string probings_part(const MachineWeek& week) {
  std::string html = html_heading("Probings");
  if (week.probings.empty())
    return html + html_paragraph("Nothing was probed: the error left at the tool is not known.");
  std::vector<std::vector<std::string>> rows{{"when", "axis", "offset", "left at the tool"}};
  for (const ProbingWeek& probing : week.probings) {
    std::string unit = "µm";
    for (const AxisWeek& axis : week.axes)
      if (axis.name == probing.axis) unit = unit_words(axis.unit);
    if (probing.dry_run) unit += " (dry run)";
    rows.push_back({local_text(probing.wall_s, in_the_week), probing.axis,
                    figure_text(probing.offset_um).append(" ").append(unit),
                    figure_text(probing.left_um).append(" ").append(unit)});
  }
  html += html_table(rows);
  if (week.candidate)
    html += html_paragraph("Candidate model, not in use: " + candidate_text(*week.candidate) + ".");
  return html + html_paragraph(
                    "Left: displacement found by the probing, with the offset at that time. In a "
                    "dry run no offset was sent, so both are hypothetical.",
                    "small");
}

std::string sensors_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"sensor", "lowest, °C", "highest, °C",
                                              "without a value", "faults", "suspected", "against",
                                              "drift, K"}};
  for (const SensorWeek& sensor : week.sensors) {
    std::size_t faults = 0;
    std::string suspected = "-";
    for (const Outages& outages : week.outages) {
      if (outages.subject == Subject{SubjectKind::sensor, sensor.name}) faults = outages.count;
      if (outages.subject == Subject{SubjectKind::suspected_sensor, sensor.name})
        suspected = duration_text(outages.lasted_s) + (outages.lasts ? ", still" : "");
    }
    const bool known = std::isfinite(sensor.drift_sd_K);
    rows.push_back(
        {sensor.name, figure_text(sensor.low_degC), figure_text(sensor.high_degC),
         figure_text(100.0 * sensor.missing_share) + " %", std::to_string(faults), suspected,
         sensor.neighbour.empty() ? "-" : sensor.neighbour,
         known ? figure_text(sensor.drift_K) + " ± " + figure_text(2.0 * sensor.drift_sd_K) : "-"});
  }
  return html_heading("Sensors") + html_table(rows) +
         html_paragraph(
             "Suspected: time during which the sensor contradicted its neighbours. Drift: change "
             "of the difference to the most similar sensor over the whole time, except for the "
             "part explained by that sensor's course; ± two standard deviations, with one "
             "independent value per six hours.",
             "small");
}

std::string outages_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"buses, units, axes", "last", "times", "in all"}};
  for (const Outages& outages : week.outages) {
    const SubjectKind kind = outages.subject.kind;
    if (kind == SubjectKind::reason || kind == SubjectKind::sensor ||
        kind == SubjectKind::suspected_sensor)
      continue;
    rows.push_back({subject_text(outages.subject), what_text(outages.last),
                    std::to_string(outages.count),
                    duration_text(outages.lasted_s) + (outages.lasts ? ", still" : "")});
  }
  const std::string table = html_table(rows);
  return html_heading("Buses and devices") +
         (table.empty() ? html_paragraph("No faults of buses, devices or controller.") : table);
}

/// A column with NaN at points of other places.
std::vector<double> only(const std::vector<double>& values, const std::vector<PointPlace>& places,
                         PointPlace place) {
  std::vector<double> kept = values;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (places[i] != place) kept[i] = not_a_number;
  return kept;
}

bool has_values(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double value) { return !std::isnan(value); });
}

std::string day_text(std::time_t seconds) {
  return local_text(static_cast<double>(seconds), "%a %d");
}

/// Ticks at the start and at local midnights.
std::vector<TimeTick> days_of(const WallSpan& span) {
  const auto from = static_cast<std::time_t>(span.from_s);
  std::vector<TimeTick> ticks{{0.0, day_text(from)}};
  std::tm day{};
  localtime_r(&from, &day);
  day.tm_hour = day.tm_min = day.tm_sec = 0;
  for (;;) {
    ++day.tm_mday;
    day.tm_isdst = -1;
    const std::time_t midnight = std::mktime(&day);
    if (midnight < 0 || static_cast<double>(midnight) >= span.to_s) return ticks;
    ticks.push_back({static_cast<double>(midnight) - span.from_s, day_text(midnight)});
  }
}

struct WeekPanels {
  std::deque<std::vector<double>> kept;  ///< storage of the lines' values
  std::vector<PlotPanel> panels;
};

std::string units_of(const MachineWeek& week) {
  std::string units;
  for (const char* unit : {"um", "urad"})
    if (std::any_of(week.axes.begin(), week.axes.end(),
                    [unit](const AxisWeek& axis) { return axis.unit == unit; }))
      units += (units.empty() ? "" : " or ") + unit_words(unit);
  return units;
}

void add_offsets(const MachineWeek& week, const std::string& title, PointPlace place,
                 WeekPanels& all) {
  const std::vector<PointPlace> places = places_of(week.course, week.sent, week.dry_runs);
  PlotPanel panel{title, units_of(week), {}, 170.0};
  std::size_t next = 0;
  for (const ThinnedColumn& column : week.course.columns) {
    constexpr std::string_view offset = "_offset_um";
    if (!column.name.ends_with(offset)) continue;
    const std::size_t number = next++;
    std::vector<double> values = only(column.values, places, place);
    if (!has_values(values)) continue;
    all.kept.push_back(std::move(values));
    panel.lines.push_back(numbered_line(column.name.substr(0, column.name.size() - offset.size()),
                                        number, all.kept.back()));
  }
  if (!panel.lines.empty()) all.panels.push_back(std::move(panel));
}

void add_temperatures(const MachineWeek& week, WeekPanels& all) {
  PlotPanel panel{"temperatures", "°C", {}, 150.0};
  constexpr std::string_view ending = "_degC";
  for (const ThinnedColumn& column : week.course.columns) {
    if (!column.name.ends_with(ending)) continue;
    panel.lines.push_back(numbered_line(column.name.substr(0, column.name.size() - ending.size()),
                                        panel.lines.size(), column.values));
  }
  if (!panel.lines.empty()) all.panels.push_back(std::move(panel));
}

std::string picture(const MachineWeek& week) {
  WeekPanels all;
  add_offsets(week, "offset sent", PointPlace::sent, all);
  add_offsets(week, "computed in the dry run, not sent", PointPlace::dry_run, all);
  add_temperatures(week, all);
  if (all.panels.empty()) return "";
  std::vector<double> since_s = week.course.time_s;
  for (double& time : since_s) time -= week.span.from_s;
  std::vector<PlotSpan> spans;
  for (const ModeSpell& spell : week.modes)
    if (spell.mode != "compensating")
      spans.push_back(
          {"", spell.span.from_s - week.span.from_s, spell.span.to_s - week.span.from_s, true});
  constexpr double days_listed_s = 36.0 * 3600.0;
  const bool by_days = week.span.length_s() > days_listed_s;
  const double mean_s = week.span.length_s() / static_cast<double>(week.course.time_s.size());
  return html_figure(
      panels_plot(since_s, all.panels, spans,
                  by_days ? days_of(week.span) : std::vector<TimeTick>{}),
      (by_days ? "A day begins at its line" : "From " + local_text(week.span.from_s)) +
          "; red: not compensating. Means of " +
          (mean_s < 1.0 ? "less than a second" : duration_text(mean_s)) + " each.");
}

}  // namespace

std::string week_html(const MachineWeek& week) {
  std::string html = html_begin((week.machine.empty() ? "" : week.machine + ": ") +
                                "report on the thermal compensation");
  const std::vector<std::string> lines = advice(week);
  html += lines.empty()
              ? html_paragraph("Good: nothing needs to be done.", "good")
              : html_paragraph("To be looked at: " + std::to_string(lines.size()) +
                                   (lines.size() == 1 ? " point, below." : " points, below."),
                               "bad");
  html += html_paragraph(summary(week));
  if (!lines.empty()) html += html_heading("What to do") + html_list(lines);
  html += html_heading("Time") + time_table(week) + why_part(week) + spells_part(week);
  html += html_heading("Offsets") + axes_part(week) + picture(week);
  html += probings_part(week) + sensors_part(week) + outages_part(week);
  html += html_paragraph("The daemon was started " + std::to_string(week.starts) +
                             (week.starts == 1 ? " time" : " times") + " and was given " +
                             std::to_string(week.commands.size()) + " commands. From " +
                             week.history + ".",
                         "small");
  return html + html_end();
}

}  // namespace thermocomp::cli
