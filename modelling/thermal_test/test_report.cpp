#include "modelling/thermal_test/test_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>

#include <nlohmann/json.hpp>

#include "estimator/types.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::thermal_test {

namespace {

/// Durations of running or record that differ by less count as equal.
constexpr double same_length_share = 0.05;
constexpr double room_difference_K = 1.0;
constexpr double start_difference_K_max = 1.0;

double length_s(const TestPhases& phases) {
  return phases.runs ? phases.running_to_s - phases.running_from_s : phases.to_s - phases.from_s;
}

double room_range_K(const TestFigures& figures) {
  double range = not_a_number;
  for (const TemperatureFigures& temperature : figures.temperatures)
    if (temperature.is_room) range = std::fmax(range, temperature.range_K);
  return range;
}

double mean_speed(const TestData& data) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < data.speed.size(); ++i) {
    if (data.speed_time_s[i] < data.phases.running_from_s) continue;
    if (data.speed_time_s[i] > data.phases.running_to_s) break;
    sum += std::abs(data.speed[i]);
    count += 1.0;
  }
  return count > 0.0 ? sum / count : not_a_number;
}

/// How much warmer the machine was at the start than the room, the room's difference left out where
/// it is not known; mean over the places that both tests have. NaN: none.
double start_difference_K(const TestFigures& before, const TestFigures& after) {
  double places_K = 0.0;
  double room_K = 0.0;
  double places = 0.0;
  double rooms = 0.0;
  for (const TemperatureFigures& first : before.temperatures)
    for (const TemperatureFigures& second : after.temperatures) {
      if (first.name != second.name) continue;
      (first.is_room ? room_K : places_K) += second.at_start_degC - first.at_start_degC;
      (first.is_room ? rooms : places) += 1.0;
    }
  return places_K / places - (rooms > 0.0 ? room_K / rooms : 0.0);
}

void add_compensation_note(TestAnswer& answer) {
  const std::optional<bool>& before = answer.before.compensated;
  const std::optional<bool>& after = answer.after->compensated;
  if (after == false)
    answer.notes.emplace_back(
        before == true ? "The first test was compensated and the second not."
                       : "No offset was in effect in the second test, so the ratio does not show "
                         "a compensation.");
  else if (before == true)
    answer.notes.emplace_back("An offset was in effect in both tests.");
}

void add_notes(TestAnswer& answer) {
  const double before_s = length_s(answer.before.phases);
  const double after_s = length_s(answer.after->phases);
  if (std::abs(before_s - after_s) > same_length_share * std::max(before_s, after_s))
    answer.notes.emplace_back(
        answer.kind == TestKind::environment
            ? "The two records differ in length; ranges grow with length, so the ratio is not "
              "reliable."
            : "The two tests did not run for the same time; both were compared until the shorter "
              "one ended.");
  const double speed_before = mean_speed(answer.before);
  const double speed_after = mean_speed(*answer.after);
  if (std::abs(speed_before - speed_after) > same_length_share * speed_before)
    answer.notes.emplace_back(
        "The mean speeds of the two tests differ by more than 5 %, so their loads are not "
        "comparable.");
  const double room_before = room_range_K(answer.before_figures);
  const double room_after = room_range_K(*answer.after_figures);
  if (std::abs(room_before - room_after) > room_difference_K)
    answer.notes.emplace_back(
        "The room temperature changed by over 1 K more in one test than in the other.");
  const double start_K = start_difference_K(answer.before_figures, *answer.after_figures);
  if (std::abs(start_K) > start_difference_K_max) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "The machine was %.1f K %s at the start of the second test, relative to the room "
                  "if recorded: the two do not begin in the same state.",
                  std::abs(start_K), start_K > 0 ? "warmer" : "colder");
    answer.notes.emplace_back(text);
  }
  add_compensation_note(answer);
}

}  // namespace

TestAnswer answer_of(TestData before, std::optional<TestData> after) {
  TestAnswer answer;
  answer.kind = before.kind;
  answer.before_figures = figures_of(before);
  answer.before = std::move(before);
  if (!after) return answer;
  answer.after_figures = figures_of(*after);
  answer.after = std::move(after);
  const double running_s = std::min(length_s(answer.before.phases), length_s(answer.after->phases));
  const TestFigures first =
      answer.before.phases.runs ? figures_until(answer.before, running_s) : answer.before_figures;
  const TestFigures second =
      answer.before.phases.runs ? figures_until(*answer.after, running_s) : *answer.after_figures;
  for (const AxisFigures& axis : first.axes)
    for (const AxisFigures& other : second.axes) {
      if (other.name != axis.name || other.unit != axis.unit) continue;
      const bool runs = answer.before.phases.runs;
      answer.ratios.push_back(
          {axis.name, axis.unit, runs ? axis.until_end : axis.whole,
           runs ? other.until_end : other.whole, ratio_of(other.first_hour, axis.first_hour),
           ratio_of(other.until_end, axis.until_end), ratio_of(other.whole, axis.whole)});
    }
  add_notes(answer);
  return answer;
}

namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json bounded_json(const Figure& figure) {
  if (!figure.is_there()) return nullptr;
  return {{"value", number(figure.value)}, {"ci99", {number(figure.low), number(figure.high)}}};
}

json axis_json(const AxisFigures& axis) {
  return {{"axis", axis.name},
          {"unit", axis.unit},
          {"values", axis.values},
          {"noise", number(axis.noise)},
          {"smoothed", axis.smoothed},
          {"range_first_60_min", bounded_json(axis.first_hour)},
          {"range_until_end", bounded_json(axis.until_end)},
          {"range_cooling", bounded_json(axis.cooling)},
          {"range_whole", bounded_json(axis.whole)},
          {"range_largest_60_min", bounded_json(axis.largest_hour)},
          {"last_by_first_60_min", bounded_json(axis.last_by_first)},
          {"settled", axis.settled ? json(*axis.settled) : json(nullptr)}};
}

json figures_json(const TestFigures& figures) {
  json result{{"file", figures.file},
              {"from_s", figures.phases.from_s},
              {"to_s", figures.phases.to_s},
              {"axes", json::array()},
              {"combined_until_end_um", bounded_json(figures.combined_until_end)},
              {"combined_whole_um", bounded_json(figures.combined_whole)},
              {"temperatures", json::array()}};
  if (figures.phases.runs) {
    result["running_from_s"] = figures.phases.running_from_s;
    result["running_to_s"] = figures.phases.running_to_s;
  }
  for (const AxisFigures& axis : figures.axes) result["axes"].push_back(axis_json(axis));
  for (const TemperatureFigures& temperature : figures.temperatures)
    result["temperatures"].push_back({{"name", temperature.name},
                                      {"room", temperature.is_room},
                                      {"at_start_degC", temperature.at_start_degC},
                                      {"range_K", temperature.range_K},
                                      {"change_K", temperature.change_K}});
  return result;
}

}  // namespace

std::string report_json(const TestAnswer& answer) {
  json result{{"test", to_string(answer.kind)},
              {"before", figures_json(answer.before_figures)},
              {"after", answer.after_figures ? figures_json(*answer.after_figures) : json(nullptr)},
              {"after_by_before", json::object()},
              {"notes", answer.notes}};
  for (const AxisRatio& ratio : answer.ratios)
    result["after_by_before"][ratio.name] = {{"first_60_min", bounded_json(ratio.first_hour)},
                                             {"until_end", bounded_json(ratio.until_end)},
                                             {"whole", bounded_json(ratio.whole)}};
  return result.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

namespace {

std::string title_of(TestKind kind) {
  if (kind == TestKind::environment) return "Drift with the surroundings";
  if (kind == TestKind::spindle) return "Drift from the running spindle";
  return "Drift from a moving axis";
}

std::string unit_words(const std::string& unit) {
  return unit == "um" ? "µm" : unit == "urad" ? "µrad" : unit;
}

std::string duration_words(double seconds) {
  char text[32];
  std::snprintf(text, sizeof text, seconds < 5400.0 ? "%.0f min" : "%.1f h",
                seconds < 5400.0 ? seconds / 60.0 : seconds / 3600.0);
  return text;
}

/// "22", "1.5": a decimal only below 10 %.
std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, share < 0.0995 ? "%.1f" : "%.0f", 100.0 * share);
  return text;
}

/// Keeps text in brackets on one line of a column.
std::string cell_of(std::string words) {
  const std::size_t bracket = words.find('(');
  for (std::size_t at = words.find(" to "); bracket != std::string::npos && at != std::string::npos;
       at = words.find(" to ", at))
    words.replace(at, 4, "\u00a0to\u00a0");
  return words;
}

std::string settled_word(const AxisFigures& axis) {
  if (!axis.last_by_first.is_there()) return "ran under 2 h";
  if (!axis.settled) return "undecided";
  return *axis.settled ? "yes" : "no";
}

std::vector<double> resampled(const std::vector<double>& at_s, const std::vector<double>& time_s,
                              const std::vector<double>& values) {
  std::vector<double> result;
  for (const double at : at_s) {
    const auto after = std::lower_bound(time_s.begin(), time_s.end(), at);
    if (time_s.empty() || at < time_s.front() - 1.0 || after == time_s.end()) {
      result.push_back(not_a_number);
      continue;
    }
    const auto i = static_cast<std::size_t>(after - time_s.begin());
    if (i == 0) {
      result.push_back(values.front());
      continue;
    }
    const double share = (at - time_s[i - 1]) / (time_s[i] - time_s[i - 1]);
    result.push_back(values[i - 1] + share * (values[i] - values[i - 1]));
  }
  return result;
}

class TestPicture {
 public:
  TestPicture(const TestData& data, const TestFigures& figures) : data_(data), figures_(figures) {
    constexpr std::size_t points = 1200;
    const TestPhases& phases = data.phases;
    zero_s_ = phases.runs ? phases.running_from_s : phases.from_s;
    for (std::size_t i = 0; i <= points; ++i)
      time_s_.push_back(phases.from_s - zero_s_ +
                        (phases.to_s - phases.from_s) * static_cast<double>(i) / points);
  }

  std::string svg() {
    add_axes("um", "displacement since the start");
    add_axes("urad", "tilt since the start");
    if (!data_.speed.empty()) {
      const std::string& name = data_.speed_name;
      const bool is_rpm = name.ends_with("_rpm");
      add("speed", is_rpm ? "1/min" : name.ends_with("_mm") ? "mm" : "mm/min", 55.0);
      panels_.back().lines.push_back({"", "#4a5568", keep(data_.speed_time_s, data_.speed)});
    }
    add_temperatures();
    std::vector<PlotSpan> spans;
    const TestPhases& phases = data_.phases;
    if (phases.runs) spans.push_back({"running", 0.0, phases.running_to_s - phases.running_from_s});
    return panels_plot(time_s_, panels_, spans);
  }

 private:
  void add(const std::string& title, const std::string& unit, double height) {
    panels_.push_back({title, unit, {}, height});
  }

  std::span<const double> keep(const std::vector<double>& time_s,
                               const std::vector<double>& values) {
    std::vector<double> since;
    since.reserve(time_s.size());
    for (const double time : time_s) since.push_back(time - zero_s_);
    kept_.push_back(std::make_unique<std::vector<double>>(resampled(time_s_, since, values)));
    return *kept_.back();
  }

  void add_axes(const std::string& unit, const std::string& title) {
    bool any = false;
    for (std::size_t i = 0; i < figures_.axes.size(); ++i) {
      const AxisFigures& axis = figures_.axes[i];
      if (axis.unit != unit) continue;
      if (!any) add(title, unit_words(unit), 190.0);
      any = true;
      kept_.push_back(
          std::make_unique<std::vector<double>>(resampled(time_s_, axis.time_s, axis.course)));
      panels_.back().lines.push_back(numbered_line(axis.name, i, *kept_.back()));
    }
  }

  void add_temperatures() {
    if (data_.temperatures.empty()) return;
    add("temperature, rise since the start", "K", 110.0);
    for (std::size_t i = 0; i < data_.temperatures.size(); ++i) {
      const TestTemperature& temperature = data_.temperatures[i];
      std::vector<double> rise = temperature.temp_degC;
      for (double& value : rise) value -= figures_.temperatures[i].at_start_degC;
      panels_.back().lines.push_back(
          numbered_line(temperature.name, i, keep(temperature.time_s, rise)));
      if (temperature.is_room) panels_.back().lines.back().colour = "#1a202c";
    }
  }

  const TestData& data_;
  const TestFigures& figures_;
  double zero_s_{0.0};
  std::vector<double> time_s_;
  std::vector<PlotPanel> panels_;
  std::vector<std::unique_ptr<std::vector<double>>> kept_;
};

std::string figure_cell(const Figure& figure) {
  return cell_of(figure_words(figure, ""));
}

std::string axes_table(const TestFigures& figures, TestKind kind) {
  std::vector<std::vector<std::string>> rows;
  if (kind == TestKind::environment)
    rows.push_back({"axis", "whole test", "largest hour"});
  else
    rows.push_back(
        {"range of", "first 60 min", "until the end", "cooling", "last by first hour", "settled"});
  for (const AxisFigures& axis : figures.axes) {
    const std::string name = axis.name + ", " + unit_words(axis.unit);
    if (kind == TestKind::environment)
      rows.push_back({name, figure_cell(axis.whole), figure_cell(axis.largest_hour)});
    else
      rows.push_back(
          {name, figure_cell(axis.first_hour), figure_cell(axis.until_end),
           figure_cell(axis.cooling),
           axis.last_by_first.is_there() ? cell_of(percent_words(axis.last_by_first)) : "-",
           settled_word(axis)});
  }
  const Figure& together =
      kind == TestKind::environment ? figures.combined_whole : figures.combined_until_end;
  if (together.is_there()) {
    std::vector<std::string> row(rows.front().size());
    row[0] = "combined, µm";
    row[kind == TestKind::environment ? 1 : 2] = figure_cell(together);
    rows.push_back(row);
  }
  return html_table(rows);
}

std::string temperatures_table(const TestFigures& figures) {
  std::vector<std::vector<std::string>> rows{
      {"temperature", "at the start, °C", "change while it ran, K", "range of the record, K"}};
  if (!figures.phases.runs) rows.front()[2] = "change to the end, K";
  for (const TemperatureFigures& temperature : figures.temperatures)
    rows.push_back(
        {temperature.name + (temperature.is_room && temperature.name != "room" ? " (room)" : ""),
         figure_text(temperature.at_start_degC), figure_text(temperature.change_K),
         figure_text(temperature.range_K)});
  return html_table(rows);
}

std::string one_test(const TestData& data, const TestFigures& figures, const std::string& heading) {
  std::string html = html_heading(heading);
  std::vector<std::string> sentences;
  for (const AxisFigures& axis : figures.axes)
    sentences.push_back(axis_sentence(axis, figures.phases));
  if (figures.combined_until_end.is_there())
    sentences.push_back("The largest distance between two places of the tool, over all axes, was " +
                        figure_words(figures.combined_until_end, "um") + ".");
  html += html_list(sentences);
  html += html_figure(TestPicture(data, figures).svg(),
                      figures.phases.runs
                          ? "Hours count from the start of running, which is shaded. Courses are "
                            "smoothed over 5 minutes where values are close enough."
                          : "Courses are smoothed over 5 minutes where values are close enough.");
  html += axes_table(figures, data.kind);
  bool has_room = false;
  for (const TemperatureFigures& temperature : figures.temperatures)
    has_room = has_room || temperature.is_room;
  html += temperatures_table(figures);
  if (!has_room)
    html += html_paragraph("The record should have a column for the room temperature (--room).",
                           "small");
  return html;
}

std::string ratios_part(const TestAnswer& answer) {
  if (!answer.after) return "";
  std::string html = html_heading("Before against after");
  const bool runs = answer.before.phases.runs;
  std::vector<std::vector<std::string>> rows{
      {runs ? "range until the end of running" : "range of the whole test", "before", "after",
       "after / before"}};
  if (runs) rows.front().push_back("likewise for the first 60 min");
  const auto share = [](const Figure& ratio) {
    return ratio.is_there() ? cell_of(percent_words(ratio)) : std::string("-");
  };
  for (const AxisRatio& ratio : answer.ratios) {
    rows.push_back({ratio.name + ", " + unit_words(ratio.unit), figure_cell(ratio.before),
                    figure_cell(ratio.after), share(runs ? ratio.until_end : ratio.whole)});
    if (runs) rows.back().push_back(share(ratio.first_hour));
  }
  html += html_table(rows);
  if (rows.size() < 2) html += html_paragraph("The two records have no axis in common.");
  return html + html_list(answer.notes);
}

std::string method_part(const TestAnswer& answer) {
  std::vector<std::string> lines{
      "A range is the largest minus the smallest displacement in a period, starting with the last "
      "value before anything ran. Figures after ISO 230-3 are the range of the whole record in a "
      "test of the environment, and the ranges over the first hour and until the end in tests of "
      "spindle and axis. Cooling, combined drift, largest hour and settling are additions. If this "
      "page and the standard differ, the standard applies.",
      "Settled: the range of the last hour of running is below 15 % of that of the first.",
      "Brackets contain the 99 % interval of the figure without the noise of the probe. The noise "
      "is estimated from second differences of neighbouring values and from the residuals of "
      "smoothing; it was drawn 1000 times, in blocks as long as the window. Noise only increases a "
      "range, so the lower bound is further away. The interval does not include errors of the "
      "probe that last longer than minutes (its own warming, its holder).",
      "The interval of a ratio assumes independent errors of both ranges."};
  for (const TestFigures* figures :
       {&answer.before_figures, answer.after_figures ? &*answer.after_figures : nullptr}) {
    if (figures == nullptr) continue;
    std::string text = "Noise of single values in " + figures->file + " (standard deviation): ";
    for (std::size_t i = 0; i < figures->axes.size(); ++i) {
      const AxisFigures& axis = figures->axes[i];
      text += (i > 0 ? ", " : "") + axis.name + " " + figure_text(axis.noise) + " " +
              unit_words(axis.unit);
      if (!axis.smoothed) text += " (too few values to smooth; may include real changes)";
    }
    lines.push_back(text + ".");
  }
  for (const std::string& description : answer.before.description)
    lines.push_back(description + ".");
  if (answer.after && answer.after->description != answer.before.description)
    for (const std::string& description : answer.after->description)
      lines.push_back("After: " + description + ".");
  return html_heading("How these figures were made") + html_list(lines);
}

}  // namespace

std::string percent_words(const Figure& ratio) {
  const std::string words = percent(ratio.value) + " %";
  // An interval from a fraction of the value to far above it gives no information.
  const bool is_wide = !(ratio.high <= 1.5);
  if (is_wide && !(ratio.low > 0.2 * ratio.value)) return words + " (may be noise alone)";
  if (std::isfinite(ratio.high))
    return words + " (" + percent(ratio.low) + " to " + percent(ratio.high) + ")";
  return words + " (at least " + percent(ratio.low) + ")";
}

std::string figure_words(const Figure& figure, const std::string& unit) {
  if (!figure.is_there()) return "-";
  std::string words = figure_text(figure.value);
  if (!unit.empty()) words += " " + unit_words(unit);
  return words + " (" + figure_text(figure.low) + " to " + figure_text(figure.high) + ")";
}

std::string axis_sentence(const AxisFigures& axis, const TestPhases& phases) {
  const bool is_distance = axis.name.find("growth") != std::string::npos;
  const std::string verb = axis.unit == "urad" ? " tilted by "
                           : is_distance       ? " changed by "
                                               : " moved by ";
  if (!phases.runs)
    return axis.name + verb + figure_words(axis.whole, axis.unit) + " in " +
           duration_words(phases.to_s - phases.from_s) + ".";
  std::string text = axis.name + verb;
  if (axis.first_hour.is_there())
    text += figure_words(axis.first_hour, axis.unit) + " in the first hour and by ";
  text += figure_words(axis.until_end, axis.unit) + " until the end of " +
          duration_words(phases.running_to_s - phases.running_from_s) + " of running";
  if (!axis.last_by_first.is_there())
    return text + "; settling needs two hours of running to be judged.";
  const std::string share =
      "the last hour moved it by " + percent_words(axis.last_by_first) + " of the first";
  if (!axis.settled) return text + "; settling is undecided: " + share + ".";
  return text + (*axis.settled ? "; it had settled: " : "; it had not settled: ") + share + ".";
}

std::string report_html(const TestAnswer& answer) {
  std::string html = html_begin(title_of(answer.kind));
  html += ratios_part(answer);
  html += one_test(answer.before, answer.before_figures,
                   answer.after ? "Before: " + answer.before.file : answer.before.file);
  if (answer.after)
    html += one_test(*answer.after, *answer.after_figures, "After: " + answer.after->file);
  return html + method_part(answer) + html_end();
}

}  // namespace thermocomp::thermal_test
