#include "cli/scan/scan_bus.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <unistd.h>

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

namespace {

namespace fs = std::filesystem;

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

bool has_open(const fs::path& process, const fs::path& device) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(process / "fd", error)) {
    const fs::path target = fs::read_symlink(entry.path(), error);
    if (!error && target == device) return true;
  }
  return false;
}

std::string name_of(const fs::path& process) {
  std::ifstream file(process / "comm");
  std::string name;
  std::getline(file, name);
  return name;
}

}  // namespace

SerialHolder holder_of(const std::string& device) {
  std::error_code error;
  const fs::path real = fs::canonical(device, error);
  SerialHolder holder;
  if (error) return holder;
  for (const auto& entry : fs::directory_iterator("/proc", error)) {
    const std::string number = entry.path().filename().string();
    if (!is_number(number) || number == std::to_string(::getpid())) continue;
    if (!has_open(entry.path(), real)) continue;
    const std::string name = name_of(entry.path());
    holder.name.assign(name).append(" (process ").append(number).append(")");
    if (name == "thermocompd") {
      holder.is_daemon = true;
      return holder;
    }
  }
  return holder;
}

}  // namespace thermocomp::cli
