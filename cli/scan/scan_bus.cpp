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
    known.stale_after_s.push_back(sensor.screening.stale_after_s);
  }
  return known;
}

bool may_come_again(nanoseconds taken_at, double stale_after_s, nanoseconds end, nanoseconds now) {
  return taken_at < end - std::chrono::seconds(1) && now - taken_at <= from_seconds(stale_after_s);
}

void judge_age(double stale_after_s, ScanChannel& result) {
  if (result.fault != Fault::none || !(result.age_s > stale_after_s)) return;
  result.fault = Fault::stale;
  result.why =
      "nothing has come since; stale_after_s of the sensor is " + short_number(stale_after_s);
}

}  // namespace thermocomp::cli
