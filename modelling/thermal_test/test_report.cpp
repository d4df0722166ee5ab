#include "modelling/thermal_test/test_report.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace thermocomp::thermal_test {

namespace {

/// Durations of running or record that differ by less count as equal.
constexpr double same_length_share = 0.05;
constexpr double room_difference_K = 1.0;

double length_s(const TestPhases& phases) {
  return phases.runs ? phases.running_to_s - phases.running_from_s : phases.to_s - phases.from_s;
}

double room_range_K(const TestFigures& figures) {
  double range = std::nan("");
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
  return count > 0.0 ? sum / count : std::nan("");
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

json figure_json(const Figure& figure) {
  if (!figure.is_there()) return nullptr;
  return {{"value", number(figure.value)}, {"ci99", {number(figure.low), number(figure.high)}}};
}

json axis_json(const AxisFigures& axis) {
  return {{"axis", axis.name},
          {"unit", axis.unit},
          {"values", axis.values},
          {"noise", number(axis.noise)},
          {"smoothed", axis.smoothed},
          {"range_first_60_min", figure_json(axis.first_hour)},
          {"range_until_end", figure_json(axis.until_end)},
          {"range_cooling", figure_json(axis.cooling)},
          {"range_whole", figure_json(axis.whole)},
          {"range_largest_60_min", figure_json(axis.largest_hour)},
          {"last_by_first_60_min", figure_json(axis.last_by_first)},
          {"settled", axis.settled ? json(*axis.settled) : json(nullptr)}};
}

json figures_json(const TestFigures& figures) {
  json result{{"file", figures.file},
              {"from_s", figures.phases.from_s},
              {"to_s", figures.phases.to_s},
              {"axes", json::array()},
              {"combined_until_end_um", figure_json(figures.combined_until_end)},
              {"combined_whole_um", figure_json(figures.combined_whole)},
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
    result["after_by_before"][ratio.name] = {{"first_60_min", figure_json(ratio.first_hour)},
                                             {"until_end", figure_json(ratio.until_end)},
                                             {"whole", figure_json(ratio.whole)}};
  return result.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace thermocomp::thermal_test
