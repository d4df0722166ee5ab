#include "cli/scan_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "cli/terminal.hpp"

namespace thermocomp::cli {
namespace {

using nlohmann::ordered_json;

std::string fixed(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string padded(std::string text, std::size_t width) {
  text.resize(std::max(text.size(), width), ' ');
  return text;
}

/// What stands after the raw bytes: the temperature, or the fault in its place.
std::string outcome(const ScanChannel& channel) {
  return channel.good() ? fixed(channel.temp_degC, 2) + " degC"
                        : std::string(to_string(channel.fault));
}

struct Widths {
  std::size_t sensor{0};
  std::size_t place{0};
  std::size_t raw{0};
};

Widths widths_of(const ScanDevice& device) {
  Widths widths;
  for (const ScanChannel& channel : device.channels) {
    widths.sensor = std::max(widths.sensor, channel.sensor.size());
    widths.place = std::max(widths.place, channel.place.size());
    widths.raw = std::max(widths.raw, std::max<std::size_t>(1, channel.raw.size()));
  }
  return widths;
}

void append(std::string& text, const ScanChannel& channel, const Widths& widths, bool colours) {
  constexpr std::size_t outcome_width = 14;
  text += "    " + padded(channel.sensor, widths.sensor) + "  " +
          padded(channel.place, widths.place) + "  " +
          padded(channel.raw.empty() ? "-" : channel.raw, widths.raw) + "  -> ";
  text += coloured(padded(outcome(channel), outcome_width),
                   channel.good() ? Colour::green : Colour::red, colours);
  if (channel.round_trip_ms)
    text.append("  ").append(fixed(*channel.round_trip_ms, 1)).append(" ms");
  if (channel.age_s) text.append("  ").append(fixed(*channel.age_s, 1)).append(" s old");
  text += '\n';
  if (!channel.why.empty()) text.append("        ").append(channel.why).append("\n");
  for (const std::string& hint : channel.hints) {
    text.append("        ").append(coloured("try:", Colour::yellow, colours));
    text.append(" ").append(hint).append("\n");
  }
}

void append(std::string& text, const ScanDevice& device, bool colours) {
  text += "  device " + device.name;
  if (!device.address.empty()) text += ", " + device.address;
  text += '\n';
  if (!device.note.empty()) text.append("      ").append(device.note).append("\n");
  const Widths widths = widths_of(device);
  for (const ScanChannel& channel : device.channels) append(text, channel, widths, colours);
}

ordered_json optional_number(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json json_of(const ScanChannel& channel) {
  return {{"sensor", channel.sensor},
          {"place", channel.place},
          {"raw", channel.raw},
          {"temp_degC", channel.good() ? ordered_json(channel.temp_degC) : ordered_json(nullptr)},
          {"fault", to_string(channel.fault)},
          {"why", channel.why},
          {"hints", channel.hints},
          {"round_trip_ms", optional_number(channel.round_trip_ms)},
          {"age_s", optional_number(channel.age_s)}};
}

ordered_json json_of(const ScanDevice& device) {
  ordered_json channels = ordered_json::array();
  for (const ScanChannel& channel : device.channels) channels.push_back(json_of(channel));
  return {{"name", device.name},
          {"address", device.address},
          {"answers", device.answers},
          {"note", device.note},
          {"channels", std::move(channels)}};
}

}  // namespace

std::size_t count_channels(const ScanReport& report) {
  std::size_t count = 0;
  for (const ScanBus& bus : report.buses) {
    for (const ScanDevice& device : bus.devices) count += device.channels.size();
  }
  return count;
}

std::size_t count_good(const ScanReport& report) {
  std::size_t count = 0;
  for (const ScanBus& bus : report.buses) {
    for (const ScanDevice& device : bus.devices) {
      count += static_cast<std::size_t>(std::count_if(
          device.channels.begin(), device.channels.end(), [](const auto& c) { return c.good(); }));
    }
  }
  return count;
}

std::string scan_text(const ScanReport& report, bool colours) {
  std::string text;
  for (const ScanBus& bus : report.buses) {
    text += "bus " + bus.name + " (" + bus.kind + ", " + bus.where + ")\n";
    if (!bus.error.empty()) {
      text += "    " + coloured(bus.error, Colour::red, colours) + "\n";
    }
    if (!bus.note.empty()) text.append("    ").append(bus.note).append("\n");
    if (!bus.found.empty()) text.append("    ").append(bus.found).append("\n");
    for (const ScanDevice& device : bus.devices) append(text, device, colours);
  }
  text += std::to_string(count_good(report)) + " of " + std::to_string(count_channels(report)) +
          " channels give a temperature\n";
  return text;
}

ordered_json scan_json(const ScanReport& report) {
  ordered_json buses = ordered_json::array();
  for (const ScanBus& bus : report.buses) {
    ordered_json devices = ordered_json::array();
    for (const ScanDevice& device : bus.devices) devices.push_back(json_of(device));
    buses.push_back({{"name", bus.name},
                     {"kind", bus.kind},
                     {"where", bus.where},
                     {"error", bus.error},
                     {"note", bus.note},
                     {"found", bus.found_numbers},
                     {"devices", std::move(devices)}});
  }
  return {{"file", report.file},
          {"channels", count_channels(report)},
          {"good", count_good(report)},
          {"buses", std::move(buses)}};
}

std::string hex_bytes(const std::vector<std::uint8_t>& bytes) {
  std::string text;
  char digits[4];
  for (const std::uint8_t byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02X", static_cast<unsigned>(byte));
    text.append(text.empty() ? "" : " ").append(digits);
  }
  return text;
}

}  // namespace thermocomp::cli
