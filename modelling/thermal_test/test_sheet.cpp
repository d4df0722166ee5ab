#include "modelling/thermal_test/test_sheet.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "config/text/problems.hpp"
#include "report/html_page.hpp"

namespace thermocomp::thermal_test {
namespace {

constexpr double rest_min = 15.0;
constexpr double step_min = 30.0;
/// Successive shares of the largest speed: up, down and a rest, as in a working day.
constexpr std::array<double, 8> step_shares{0.25, 0.5, 0.75, 1.0, 0.5, 0.0, 1.0, 0.75};
constexpr double constant_share = 0.75;
constexpr double rows_max = 2000.0;

[[noreturn]] void refuse(const char* key, const std::string& value, const char* rule) {
  throw ConfigurationError({Problem{"thermal-test plan", 0, key, value, rule}});
}

double full_speed(const SheetOptions& options) {
  const bool spindle = options.kind == TestKind::spindle;
  const double speed = spindle ? options.rpm_max : options.feed_mm_per_min;
  if (!(speed > 0.0)) {
    if (spindle)
      refuse("--rpm-max", "(missing)", "the largest speed of the spindle in 1/min is needed");
    refuse("--feed", "(missing)", "the feed in mm/min at which the axis moves is needed");
  }
  return speed;
}

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::vector<std::string> columns_of(const SheetOptions& options) {
  std::vector<std::string> columns{"time [min]"};
  if (options.kind == TestKind::axis) {
    columns.insert(columns.end(),
                   {"feed_mm_per_min", "x1_um", "y1_um", "z1_um", "x2_um", "y2_um", "z2_um"});
  } else {
    if (options.kind == TestKind::spindle) columns.emplace_back("spindle_rpm");
    columns.insert(columns.end(), {"x1_um", "y1_um", "x2_um", "y2_um", "z_um"});
  }
  columns.insert(columns.end(), {"room_degC", "spindle_degC", "bed_degC"});
  return columns;
}

double speed_at(const std::vector<SheetStep>& steps, double minute) {
  double speed = 0.0;
  for (const SheetStep& step : steps)
    if (minute >= step.from_min) speed = step.speed;
  return speed;
}

std::vector<std::string> what_to_do(const SheetOptions& options) {
  std::vector<std::string> lines;
  if (options.kind == TestKind::axis) {
    char first[200];
    std::snprintf(first, sizeof first,
                  "Axis %c moves between both ends of its travel, with probes at each (positions 1 "
                  "and 2) and a test sphere or block in the spindle. The spindle is at rest.",
                  options.moving - 'a' + 'A');
    lines.emplace_back(first);
    lines.emplace_back(
        "Between two readings the axis moves back and forth between them at the feed of "
        "its row; at a reading it stops at 1, then at 2.");
  } else {
    lines.emplace_back(
        "Put a test bar into the spindle and five probes on the table: X1 and Y1 at its free "
        "end, X2 and Y2 nearer to the spindle, Z on its face. Note the distance "
        "between the pairs.");
    lines.emplace_back(options.kind == TestKind::spindle
                           ? "The speed of a row applies from its time on. Stop for a reading only "
                             "if the probes cannot read a rotating bar."
                           : "Drives are on, spindle and axes at rest, doors as in normal use.");
  }
  lines.emplace_back(
      "Before the first row the machine is on, at rest and at a uniform temperature; every "
      "reading is taken at the same place of all axes.");
  lines.emplace_back(
      "Run the test once with the compensation off (thermocomp disable) and once with it "
      "on, each from the cold, at the same speeds.");
  lines.emplace_back(
      "Record room, spindle and bed; add a column ending with _degC for each further "
      "temperature. Leave missing values empty.");
  return lines;
}

std::string options_of_report(const SheetOptions& options) {
  std::string text = "thermocomp thermal-test report THIS.csv --test " + to_string(options.kind);
  if (options.kind != TestKind::axis) text += " --distance-mm MM";
  return text + " -o REPORT.html";
}

std::string step_words(const SheetStep& step, const SheetOptions& options) {
  if (options.kind == TestKind::environment) return "record";
  if (step.speed == 0.0) return "at rest";
  return options.kind == TestKind::spindle ? "spindle at " + short_number(step.speed) + " 1/min"
                                           : "feed " + short_number(step.speed) + " mm/min";
}

std::vector<double> minutes_of(const SheetOptions& options, const std::vector<SheetStep>& steps) {
  const double end_min = steps.back().to_min;
  if (!(options.every_min > 0.0) || end_min / options.every_min > rows_max)
    refuse("--every-min", short_number(options.every_min), "must give at most 2000 rows");
  std::vector<double> minutes;
  for (double minute = 0.0; minute <= end_min + 1e-9; minute += options.every_min)
    minutes.push_back(minute);
  return minutes;
}

}  // namespace

std::vector<SheetStep> sheet_steps(const SheetOptions& options) {
  const double running_min = 60.0 * options.hours;
  if (!(options.hours > 0.0 && options.hours <= 168.0))
    refuse("--hours", short_number(options.hours), "must be above 0, at most 168");
  if (options.kind == TestKind::environment) return {{0.0, running_min, 0.0}};
  if (!(options.cooling_h >= 0.0 && options.cooling_h <= 48.0))
    refuse("--cooling-hours", short_number(options.cooling_h), "must be from 0 to 48");
  const double speed = full_speed(options);
  const bool spindle = options.kind == TestKind::spindle;
  std::vector<SheetStep> steps{{0.0, rest_min, 0.0}};
  const double end_min = rest_min + running_min;
  if (!options.steps || !spindle) {
    steps.push_back({rest_min, end_min, spindle ? constant_share * speed : speed});
  } else {
    std::size_t next = 0;
    for (double from = rest_min; from < end_min; from += step_min)
      steps.push_back({from, std::min(end_min, from + step_min),
                       speed * step_shares[next++ % step_shares.size()]});
    // A final rest would already be cooling.
    if (steps.back().speed == 0.0) steps.back().speed = constant_share * speed;
  }
  if (options.cooling_h > 0.0) steps.push_back({end_min, end_min + 60.0 * options.cooling_h, 0.0});
  return steps;
}

std::string sheet_csv(const SheetOptions& options) {
  const std::vector<SheetStep> steps = sheet_steps(options);
  std::string text("# Plan of a test of thermal behaviour after ISO 230-3: ");
  text.append(to_string(options.kind)).append("\n");
  for (const std::string& line : what_to_do(options)) text.append("# ").append(line).append("\n");
  text.append("# Filled in: ").append(options_of_report(options)).append("\n");
  const std::vector<std::string> columns = columns_of(options);
  for (std::size_t i = 0; i < columns.size(); ++i) text.append(i > 0 ? "," : "").append(columns[i]);
  text += "\n";
  const bool has_speed = options.kind != TestKind::environment;
  for (const double minute : minutes_of(options, steps)) {
    text += short_number(minute);
    if (has_speed) text.append(",").append(short_number(speed_at(steps, minute)));
    text.append(columns.size() - (has_speed ? 2 : 1), ',').append("\n");
  }
  return text;
}

std::string sheet_html(const SheetOptions& options) {
  const std::vector<SheetStep> steps = sheet_steps(options);
  std::string html = html_begin("Test of thermal behaviour: " + to_string(options.kind));
  html += html_paragraph(
      "A plan after ISO 230-3; if both differ, the standard applies. Buyer and "
      "maker may agree on speeds and times.");
  html += html_table(
      {{"machine", "number", "date", "by", "compensation on or off"}, {"\u00a0", "", "", "", ""}});
  html += html_heading("What to do") + html_list(what_to_do(options));
  std::vector<std::vector<std::string>> plan{{"from, min", "to, min", ""}};
  for (const SheetStep& step : steps)
    plan.push_back(
        {short_number(step.from_min), short_number(step.to_min), step_words(step, options)});
  html += html_heading("Schedule") + html_table(plan);
  std::vector<std::vector<std::string>> rows{columns_of(options)};
  const bool has_speed = options.kind != TestKind::environment;
  for (const double minute : minutes_of(options, steps)) {
    std::vector<std::string> cells(rows.front().size());
    cells[0] = short_number(minute);
    if (has_speed) cells[1] = short_number(speed_at(steps, minute));
    rows.push_back(cells);
  }
  html += html_heading("Readings") + html_table(rows);
  html += html_paragraph(
      "Enter the readings into a file with these columns, then: " + options_of_report(options),
      "small");
  return html + html_end();
}

}  // namespace thermocomp::thermal_test
