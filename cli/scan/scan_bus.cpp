#include "cli/scan/scan_bus.hpp"

#include <cstdio>

namespace thermocomp::cli {

std::string short_number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

ScanSensors scan_sensors(std::span<const SensorConfig> sensors) {
  ScanSensors known;
  for (const SensorConfig& sensor : sensors) {
    known.names.push_back(sensor.name);
    known.ranges.push_back({sensor.screening.temp_degC_min, sensor.screening.temp_degC_max});
  }
  return known;
}

}  // namespace thermocomp::cli
