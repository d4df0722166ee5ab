#include <cmath>

#include <nlohmann/json.hpp>

#include "modelling/thermal_test/test_report.hpp"

namespace thermocomp::thermal_test {
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
