#include "cli/report/week_page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <deque>
#include <string_view>
#include <utility>

#include "cli/observe/status_text.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

constexpr std::array<const char*, 8> colours = {"#2b6cb0", "#c05621", "#2f855a", "#6b46c1",
                                                "#b7791f", "#97266d", "#285e61", "#4a5568"};
constexpr std::size_t named_max = 8;

std::string local_text(double wall_s) {
  const auto seconds = static_cast<std::time_t>(wall_s);
  std::tm parts{};
  localtime_r(&seconds, &parts);
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", &parts);
  return text.data();
}

std::string mode_words(const std::string& name) {
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
                     ") the machine was compensated for " + duration_text(on_s);
  if (week.recorded_s > 0.0)
    text += ", that is " + figure_text(100.0 * on_s / week.recorded_s) +
            " % of the time in which the daemon ran";
  text += ".";
  if (week.dry_run_s() > 0.0)
    text += " Of the time in which it ran, " + duration_text(week.dry_run_s()) +
            " were a dry run: everything was computed and recorded, and nothing was sent to the "
            "machine.";
  return text;
}

std::string time_table(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"mode", "time", "share of the whole"}};
  const auto add = [&](const std::string& what, double seconds) {
    constexpr double told_s_min = 1.0;
    if (seconds < told_s_min) return;
    rows.push_back(
        {what, duration_text(seconds), figure_text(100.0 * seconds / week.span.length_s()) + " %"});
  };
  double told_s = 0.0;
  for (const char* mode :
       {"compensating", "holding", "ramping_to_zero", "disabled", "starting", "dry_run"}) {
    add(mode_words(mode), week.mode_s(mode));
    told_s += week.mode_s(mode);
  }
  add("recorded, mode not known", week.recorded_s - told_s);
  add("the daemon did not run", week.span.length_s() - week.recorded_s);
  return html_table(rows);
}

std::string spells_part(const MachineWeek& week) {
  constexpr std::size_t told_max = 12;
  constexpr double told_s = 60.0;
  std::vector<std::vector<std::string>> rows{{"not compensating", "from", "for"}};
  std::size_t more = 0;
  for (const ModeSpell& spell : week.modes) {
    if (spell.mode == "compensating" || spell.span.length_s() < told_s) continue;
    if (rows.size() > told_max) {
      ++more;
      continue;
    }
    rows.push_back({mode_words(spell.mode), local_text(spell.span.from_s),
                    duration_text(spell.span.length_s())});
  }
  std::string html = html_table(rows);
  if (more > 0)
    html += html_paragraph("and " + std::to_string(more) + " more of a minute or longer", "small");
  return html;
}

std::string why_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"why it did less than it could", "times", "in all"}};
  for (const Outages& outages : week.outages)
    // A suspicion stands with its sensor; by itself it takes nothing away.
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
      rows.push_back({axis.name + ", " + unit_words(axis.unit), figure_text(-of.high_um),
                      figure_text(-of.low_um), figure_text(of.mean_size_um),
                      figure_text(axis.bound_um), figure_text(100.0 * of.at_bound_share) + " %"});
  }
  return html_table(rows);
}

std::string axes_part(const MachineWeek& week) {
  std::string html = ranges_table(week, "displacement taken out", &AxisWeek::sent);
  if (html.empty()) html = html_paragraph("Nothing was taken out.");
  const std::string dry =
      ranges_table(week, "computed in the dry run, not taken out", &AxisWeek::dry_run);
  return dry.empty() ? html : html + dry;
}

std::string probings_part(const MachineWeek& week) {
  std::string html = html_heading("Probings");
  if (week.probings.empty())
    return html + html_paragraph("Nothing was probed, so nothing says what is left at the tool.");
  std::vector<std::vector<std::string>> rows{{"when", "axis", "taken out", "left at the tool"}};
  for (const ProbingWeek& probing : week.probings) {
    std::string unit = "µm";
    for (const AxisWeek& axis : week.axes)
      if (axis.name == probing.axis) unit = unit_words(axis.unit);
    if (probing.dry_run) unit += " (dry run)";
    rows.push_back({local_text(probing.wall_s), probing.axis,
                    figure_text(probing.claimed_um).append(" ").append(unit),
                    figure_text(probing.left_um).append(" ").append(unit)});
  }
  html += html_table(rows);
  if (week.candidate)
    html += html_paragraph(
        "A model that runs beside and is not used: " + candidate_text(*week.candidate) + ".");
  return html + html_paragraph(
                    "Taken out: the offset at that moment, which is what the model "
                    "claimed as far as bound and slew let it. Left: what the probing "
                    "found with it. In a dry run nothing was sent: what would have been taken "
                    "out, and what would have been left.",
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
             "Suspected: the time in which the daemon found the sensor against what its neighbours "
             "said of it. Drift: of the difference to the sensor that moved most like it, over the "
             "whole time, beside what follows from that one's own course; ± two standard "
             "deviations, six hours counted as one independent value.",
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

/// A column where its points lie in one place; gaps elsewhere.
std::vector<double> only(const std::vector<double>& values, const std::vector<PointPlace>& places,
                         PointPlace place) {
  std::vector<double> kept = values;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (places[i] != place) kept[i] = std::nan("");
  return kept;
}

bool has_values(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double value) { return !std::isnan(value); });
}

std::string day_text(std::time_t seconds) {
  std::tm day{};
  localtime_r(&seconds, &day);
  std::array<char, 16> text{};
  std::strftime(text.data(), text.size(), "%a %d", &day);
  return text.data();
}

/// The beginning, and the midnights of the machine's place: a course of some days is read by them.
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
  std::deque<std::vector<double>> kept;  ///< what the lines look at
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
    const char* colour = colours[next++ % colours.size()];
    std::vector<double> values = only(column.values, places, place);
    if (!has_values(values)) continue;
    for (double& value : values) value = -value;  // of the offset: what it takes out
    all.kept.push_back(std::move(values));
    panel.lines.push_back(
        {column.name.substr(0, column.name.size() - offset.size()), colour, all.kept.back()});
  }
  if (!panel.lines.empty()) all.panels.push_back(std::move(panel));
}

void add_temperatures(const MachineWeek& week, WeekPanels& all) {
  PlotPanel panel{"temperatures", "°C", {}, 150.0};
  constexpr std::string_view ending = "_degC";
  for (const ThinnedColumn& column : week.course.columns) {
    if (!column.name.ends_with(ending)) continue;
    panel.lines.push_back({column.name.substr(0, column.name.size() - ending.size()),
                           colours[panel.lines.size() % colours.size()], column.values});
  }
  if (panel.lines.size() > named_max)
    for (PlotLine& line : panel.lines) line.label.clear();
  if (!panel.lines.empty()) all.panels.push_back(std::move(panel));
}

std::string picture(const MachineWeek& week) {
  WeekPanels all;
  add_offsets(week, "displacement taken out", PointPlace::sent, all);
  add_offsets(week, "computed in the dry run, not taken out", PointPlace::dry_run, all);
  add_temperatures(week, all);
  if (all.panels.empty()) return "";
  std::vector<double> since_s = week.course.time_s;
  for (double& time : since_s) time -= week.span.from_s;
  std::vector<PlotSpan> spans;
  for (const ModeSpell& spell : week.modes)
    if (spell.mode == "compensating")
      spans.push_back(
          {"", spell.span.from_s - week.span.from_s, spell.span.to_s - week.span.from_s});
  constexpr double days_told_s = 36.0 * 3600.0;
  const bool by_days = week.span.length_s() > days_told_s;
  const double mean_s = week.span.length_s() / static_cast<double>(week.course.time_s.size());
  return html_figure(
      panels_plot(since_s, all.panels, spans,
                  by_days ? days_of(week.span) : std::vector<TimeTick>{}),
      (by_days ? "A day begins at its line" : "From " + local_text(week.span.from_s)) +
          "; shaded: compensating. Means of " +
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
  html += html_heading("Displacement") + axes_part(week) + picture(week);
  html += probings_part(week) + sensors_part(week) + outages_part(week);
  html += html_paragraph("The daemon was started " + std::to_string(week.starts) +
                             (week.starts == 1 ? " time" : " times") + " and was given " +
                             std::to_string(week.commands.size()) + " commands. From " +
                             week.history + ".",
                         "small");
  return html + html_end();
}

}  // namespace thermocomp::cli
