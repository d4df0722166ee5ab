#include "estimator/temperature_range.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

std::string to_text(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

}  // namespace

TemperatureRange::TemperatureRange(const EstimatorConfig& config, const std::string& column) {
  for (const BlockConfig& block : config.blocks) {
    if (block.input != column) continue;
    for (const std::size_t index : block.sensors) {
      // A configuration that is still being checked may name sensors that are none.
      if (index >= config.sensors.size()) continue;
      const SensorConfig& sensor = config.sensors[index];
      double low = sensor.screening.temp_degC_min;
      double high = sensor.screening.temp_degC_max;
      if (sensor.reference_sensor) {
        const ScreeningConfig& other = config.sensors[*sensor.reference_sensor].screening;
        low -= other.temp_degC_max;
        high -= other.temp_degC_min;
      }
      degC_min_ = std::isnan(degC_min_) ? low : std::min(degC_min_, low);
      degC_max_ = std::isnan(degC_max_) ? high : std::max(degC_max_, high);
    }
  }
}

bool TemperatureRange::holds(double temp_degC) const noexcept {
  if (std::isnan(degC_min_)) return std::isfinite(temp_degC);
  return temp_degC >= degC_min_ && temp_degC <= degC_max_;
}

std::string TemperatureRange::rule() const {
  if (std::isnan(degC_min_)) return "must be a finite number";
  std::string text("must be in [");
  text.append(to_text(degC_min_)).append(", ").append(to_text(degC_max_));
  return text.append("], what the screening of its sensors lets through");
}

std::vector<std::string> impossible_references(
    const EstimatorConfig& config, const std::vector<std::string>& columns,
    const std::map<std::string, double>& reference_degC) {
  std::vector<std::string> refused;
  for (const std::string& column : columns) {
    const auto found = reference_degC.find(column);
    if (found == reference_degC.end() || std::isnan(found->second)) continue;
    const TemperatureRange range(config, column);
    if (range.holds(found->second)) continue;
    std::string text("reference_degC.");
    text.append(column).append(" = ").append(to_text(found->second));
    refused.push_back(text.append(" ").append(range.rule()));
  }
  return refused;
}

void check_reference(const EstimatorConfig& config, const ThermalModel& model) {
  for (std::size_t i = 0; i < model.reference_degC.size(); ++i) {
    const TemperatureRange range(config, model.inputs[i]);
    std::string key("reference[");
    key.append(std::to_string(i)).append("]");
    require(range.holds(model.reference_degC[i]), key.c_str(), model.reference_degC[i],
            range.rule().c_str());
  }
}

}  // namespace thermocomp
