#include "cli/report/week_page.hpp"

#include <array>
#include <cmath>
#include <ctime>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "modelling/markup/html_page.hpp"
#include "modelling/markup/svg_plot.hpp"

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

std::string hours(double seconds) {
  return figure_text(seconds / 3600.0) + " h";
}

std::string mode_words(const std::string& mode) {
  if (mode == "compensating") return "compensating";
  if (mode == "holding") return "data lost, last offsets held";
  if (mode == "ramping_to_zero") return "data lost, offsets taken back to zero";
  if (mode == "disabled") return "switched off";
  if (mode == "starting") return "starting";
  if (mode == "dry_run") return "dry run, nothing written";
  return mode;
}

std::string unit_words(const std::string& unit) {
  return unit == "urad" ? "µrad" : "µm";
}

std::string summary(const MachineWeek& week) {
  const double on_s = week.mode_s("compensating");
  std::string text = "From " + local_text(week.span.from_s) + " to " + local_text(week.span.to_s) +
                     " (" + duration_text(week.span.length_s()) +
                     ") the machine was compensated for " + hours(on_s);
  if (week.recorded_s > 0.0)
    text += ", that is " + figure_text(100.0 * on_s / week.recorded_s) +
            " % of the time in which the daemon ran";
  return text + ".";
}

std::string time_table(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"", "time", "share"}};
  const auto add = [&](const std::string& what, double seconds) {
    if (seconds < 1.0) return;
    rows.push_back(
        {what, hours(seconds), figure_text(100.0 * seconds / week.span.length_s()) + " %"});
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
    if (outages.subject.starts_with("reason "))
      rows.push_back({std::string(reason_text(outages.what).meaning), std::to_string(outages.count),
                      duration_text(outages.lasted_s)});
  return html_table(rows);
}

std::string axes_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{
      {"displacement taken out", "least", "most", "mean size", "bound", "at the bound"}};
  for (const AxisWeek& axis : week.axes)
    rows.push_back({axis.name + ", " + unit_words(axis.unit), figure_text(-axis.high_um),
                    figure_text(-axis.low_um), figure_text(axis.mean_size_um),
                    figure_text(axis.bound_um), figure_text(100.0 * axis.at_bound_share) + " %"});
  return html_table(rows);
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
    rows.push_back({local_text(probing.wall_s), probing.axis,
                    figure_text(probing.claimed_um) + " " + unit,
                    figure_text(probing.left_um) + " " + unit});
  }
  html += html_table(rows);
  return html + html_paragraph(
                    "Taken out: the offset at that moment, which is what the model "
                    "claimed as far as bound and slew let it. Left: what the probing "
                    "found with it.",
                    "small");
}

std::string sensors_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{
      {"sensor", "lowest, °C", "highest, °C", "without a value", "faults", "against", "drift, K"}};
  for (const SensorWeek& sensor : week.sensors) {
    std::size_t faults = 0;
    for (const Outages& outages : week.outages)
      if (outages.subject == "sensor " + sensor.name) faults = outages.count;
    const bool known = std::isfinite(sensor.drift_sd_K);
    rows.push_back(
        {sensor.name, figure_text(sensor.low_degC), figure_text(sensor.high_degC),
         figure_text(100.0 * sensor.missing_share) + " %", std::to_string(faults),
         sensor.neighbour.empty() ? "-" : sensor.neighbour,
         known ? figure_text(sensor.drift_K) + " ± " + figure_text(2.0 * sensor.drift_sd_K) : "-"});
  }
  return html_heading("Sensors") + html_table(rows) +
         html_paragraph(
             "Drift: of the difference to the sensor that moved most like it, over the "
             "whole time, beside what follows from that one's own course; ± two standard "
             "deviations, six hours counted as one independent value.",
             "small");
}

std::string outages_part(const MachineWeek& week) {
  std::vector<std::vector<std::string>> rows{{"buses, units, axes", "last", "times", "in all"}};
  for (const Outages& outages : week.outages) {
    if (outages.subject.starts_with("reason ") || outages.subject.starts_with("sensor ")) continue;
    rows.push_back({outages.subject, outages.what, std::to_string(outages.count),
                    duration_text(outages.lasted_s) + (outages.lasts ? ", still" : "")});
  }
  const std::string table = html_table(rows);
  return html_heading("Buses and devices") +
         (table.empty() ? html_paragraph("No faults of buses, devices or controller.") : table);
}

std::string picture(const MachineWeek& week) {
  std::vector<PlotPanel> panels{{"offsets as sent", "µm or µrad", {}, 170.0},
                                {"temperatures", "°C", {}, 150.0}};
  std::size_t temperatures = 0;
  for (const ThinnedColumn& column : week.course.columns)
    if (column.name.ends_with("_degC")) ++temperatures;
  std::size_t next[2] = {0, 0};
  for (const ThinnedColumn& column : week.course.columns) {
    const bool is_temperature = column.name.ends_with("_degC");
    std::string name = column.name.substr(0, column.name.size() - (is_temperature ? 5 : 10));
    if (is_temperature && temperatures > named_max) name.clear();
    const std::size_t panel = is_temperature ? 1 : 0;
    panels[panel].lines.push_back({name, colours[next[panel]++ % colours.size()], column.values});
  }
  if (panels[1].lines.empty()) panels.pop_back();
  if (panels[0].lines.empty()) panels.erase(panels.begin());
  if (panels.empty()) return "";
  std::vector<double> since_s = week.course.time_s;
  for (double& time : since_s) time -= week.span.from_s;
  std::vector<PlotSpan> spans;
  for (const ModeSpell& spell : week.modes)
    if (spell.mode == "compensating")
      spans.push_back(
          {"", spell.span.from_s - week.span.from_s, spell.span.to_s - week.span.from_s});
  return html_figure(
      panels_plot(since_s, panels, spans),
      "Hours from " + local_text(week.span.from_s) + "; shaded: compensating. Means of " +
          duration_text(week.span.length_s() / static_cast<double>(week.course.time_s.size())) +
          " each.");
}

}  // namespace

std::string week_html(const MachineWeek& week) {
  std::string html = html_begin("Thermal compensation: report");
  html += html_paragraph(summary(week));
  const std::vector<std::string> lines = advice(week);
  html += html_heading("What to do");
  html += lines.empty() ? html_paragraph("Nothing.") : html_list(lines);
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
