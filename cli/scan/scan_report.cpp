#include "cli/scan/scan_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "cli/common/modbus_names.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "report/terminal.hpp"
#include "status/codes.hpp"

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

/// The temperature, or the fault in its place.
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

void append(std::string& text, const ScanController& controller, bool colours) {
  text += "controller " + controller.name + " (" + controller.kind + ", " + controller.where + ")" +
          (controller.address.empty() ? "" : ", " + controller.address) + "\n";
  for (const std::string& trouble : {controller.error, controller.refused})
    if (!trouble.empty()) text += "    " + coloured(trouble, Colour::red, colours) + "\n";
  std::size_t what_width = 0;
  std::size_t place_width = 0;
  std::size_t raw_width = 1;
  for (const ScanValue& value : controller.values) {
    what_width = std::max(what_width, value.what.size());
    place_width = std::max(place_width, value.place.size());
    raw_width = std::max(raw_width, value.raw.size());
  }
  for (const ScanValue& value : controller.values) {
    text += "    " + padded(value.what, what_width) + "  " + padded(value.place, place_width) +
            "  " + padded(value.raw.empty() ? "-" : value.raw, raw_width) + "  -> ";
    const std::string shown =
        value.is_there()  ? fixed(value.value, 2) + (value.unit.empty() ? "" : " " + value.unit)
        : value.is_needed ? "missing"
                          : "cannot be read, is only written";
    text += coloured(shown, value.is_missing() ? Colour::red : Colour::green, colours);
    if (value.round_trip_ms) text.append("  ").append(fixed(*value.round_trip_ms, 1)).append(" ms");
    text += '\n';
    if (!value.is_there()) text.append("        ").append(value.why).append("\n");
  }
  if (!controller.writes.empty()) text.append("    ").append(controller.writes).append("\n");
}

/// "8 of 11 values of the controller are present; missing: x_mm, heartbeat; not known: offset of
/// axis z"
std::string controller_summary(const ScanController& controller) {
  std::string missing;
  std::string unknown;
  std::size_t there = 0;
  for (const ScanValue& value : controller.values) {
    if (value.is_there())
      ++there;
    else if (value.is_missing())
      missing += (missing.empty() ? "; missing: " : ", ") + value.what;
    else
      unknown += (unknown.empty() ? "; not known: " : ", ") + value.what;
  }
  return std::to_string(there) + " of " + std::to_string(controller.values.size()) +
         " values of the controller are present" + missing + unknown + "\n";
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

ordered_json json_of(const ScanController& controller) {
  ordered_json values = ordered_json::array();
  for (const ScanValue& value : controller.values)
    values.push_back({{"what", value.what},
                      {"place", value.place},
                      {"written", value.is_written},
                      {"raw", value.raw},
                      {"value", optional_number(value.value)},
                      {"unit", value.unit},
                      {"why", value.why},
                      {"needed", value.is_needed},
                      {"round_trip_ms", optional_number(value.round_trip_ms)}});
  return {{"name", controller.name},     {"kind", controller.kind},
          {"where", controller.where},   {"address", controller.address},
          {"error", controller.error},   {"refused", controller.refused},
          {"writes", controller.writes}, {"complete", controller.is_complete()},
          {"values", std::move(values)}};
}

}  // namespace

void judge_turns(std::span<const double> temps_degC, ScanChannel& result) {
  constexpr std::size_t values_min = 6;
  constexpr double jump_K_min = 0.25;
  const std::size_t count = temps_degC.size();
  if (result.fault != Fault::none || count < values_min) return;
  std::size_t others = 0;
  for (std::size_t i = 2; i < count; ++i) {
    const double jump_K = std::abs(temps_degC[i] - temps_degC[i - 1]);
    const double change_K = std::abs(temps_degC[i] - temps_degC[i - 2]);
    if (!(jump_K >= jump_K_min && 4.0 * change_K < jump_K)) ++others;
  }
  if (10 * others > count) return;
  result.fault = Fault::device_error;
  result.why = "jumps between " + fixed(temps_degC[count - 2], 2) + " and " +
               fixed(temps_degC[count - 1], 2) +
               " degC in turn: two senders? Give one of them another identifier";
}

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

bool ScanController::is_complete() const {
  return error.empty() && refused.empty() &&
         std::none_of(values.begin(), values.end(), [](const auto& v) { return v.is_missing(); });
}

bool is_complete(const ScanReport& report) {
  return count_good(report) == count_channels(report) &&
         (!report.controller || report.controller->is_complete());
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
  if (report.controller) append(text, *report.controller, colours);
  if (!report.buses.empty())
    text += std::to_string(count_good(report)) + " of " + std::to_string(count_channels(report)) +
            " channels give a temperature\n";
  if (report.controller) text += controller_summary(*report.controller);
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
          {"buses", std::move(buses)},
          {"controller", report.controller ? json_of(*report.controller) : ordered_json(nullptr)}};
}

void note_fahrenheit(ScanReport& report) {
  constexpr double room_degF_min = 59.0;   // 15 degC
  constexpr double room_degF_max = 104.0;  // 40 degC
  const auto in_degC = [](double temp_degF) { return (temp_degF - 32.0) / 1.8; };
  for (ScanBus& bus : report.buses)
    for (ScanDevice& device : bus.devices) {
      std::vector<double> temps;
      for (const ScanChannel& channel : device.channels)
        if (channel.good()) temps.push_back(channel.temp_degC);
      if (temps.empty() || !device.note.empty()) continue;
      const auto [low, high] = std::minmax_element(temps.begin(), temps.end());
      if (*low < room_degF_min || *high > room_degF_max) continue;
      device.note = fixed(*low, 1) + " to " + fixed(*high, 1) + " degC; as degF it would be " +
                    fixed(in_degC(*low), 1) + " to " + fixed(in_degC(*high), 1) +
                    " degC. If the machine is cold, set the module to degrees Celsius";
    }
}

std::string hex_words(std::span<const std::uint16_t> words) {
  std::vector<std::uint8_t> bytes;
  for (const std::uint16_t word : words) {
    bytes.push_back(static_cast<std::uint8_t>(word >> 8));
    bytes.push_back(static_cast<std::uint8_t>(word & 0xFF));
  }
  return hex_bytes(bytes);
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

namespace {

std::string temperature_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.2f degC", value);
  return text;
}

Decoded decode_as(const ModbusChannel& channel, WordOrder order, double scale,
                  std::span<const std::uint16_t> words) {
  return decode(words,
                format_in(channel.table, {channel.encoding, order, scale, channel.offset_degC}),
                channel.sentinels);
}

bool fits(const ModbusChannel& channel, const Decoded& decoded, const PlausibleRange& range) {
  return decoded.fault == Fault::none && is_plausible(channel, decoded.value, range);
}

void hint_orders(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  const bool one_register = registers_of(channel.encoding) == 1;
  for (const WordOrder order :
       {WordOrder::abcd, WordOrder::cdab, WordOrder::badc, WordOrder::dcba}) {
    if (order == channel.word_order) continue;
    // A single register has only two byte orders.
    if (one_register && (order == WordOrder::cdab || order == WordOrder::dcba)) continue;
    const Decoded decoded = decode_as(channel, order, channel.scale, words);
    if (!fits(channel, decoded, range)) continue;
    hints.push_back("word_order = \"" + order_name(order) + "\" would make it " +
                    temperature_text(decoded.value));
  }
}

/// Hints at two probes packed into one register, a byte each.
void hint_halves(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  constexpr double apart_K_max = 20.0;  // two probes of one module; few other numbers agree so well
  if (channel.encoding != Encoding::int16 && channel.encoding != Encoding::uint16) return;
  NumberFormat half = format_of(channel);
  half.mask = 0xFF00;
  const Decoded high = decode(words, half, {});
  half.mask = 0x00FF;
  const Decoded low = decode(words, half, {});
  if (!fits(channel, high, range) || !fits(channel, low, range)) return;
  if (std::abs(high.value - low.value) > apart_K_max || low.value == channel.offset_degC) return;
  hints.push_back("two probes in one register? mask = 0xFF00 would make it " +
                  temperature_text(high.value) + ", mask = 0x00FF " + temperature_text(low.value));
}

void hint_scales(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  for (const double factor : {0.1, 0.01}) {
    const double scale = channel.scale * factor;
    const Decoded decoded = decode_as(channel, channel.word_order, scale, words);
    if (!fits(channel, decoded, range) || decoded.value == channel.offset_degC) continue;
    char text[80];
    std::snprintf(text, sizeof text, "scale = %g would make it ", scale);
    hints.push_back(text + temperature_text(decoded.value));
    return;
  }
}

double raw_value(const ModbusChannel& channel, std::span<const std::uint16_t> words) {
  return decode(words, format_in(channel.table, {channel.encoding, channel.word_order}), {}).value;
}

void hint_codes(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                std::vector<std::string>& hints) {
  if (const auto code = likely_open_code(channel, words)) {
    const std::string number = std::to_string(*code);
    hints.push_back(number +
                    " is what many modules send for a broken wire; if the manual confirms it: "
                    "open_circuit_codes = [" +
                    number + "]");
  }
  if (std::isnan(raw_value(channel, words))) hints.emplace_back(nan_text().remedy);
}

}  // namespace

std::optional<std::int64_t> likely_open_code(const ModbusChannel& channel,
                                             std::span<const std::uint16_t> words) {
  constexpr std::array ends{32767.0, 32766.0, 32000.0, -32768.0,     -32767.0,      -32000.0,
                            65535.0, 9999.0,  -9999.0, 2147483647.0, -2147483648.0, 4294967295.0};
  const double raw = raw_value(channel, words);
  for (const double end : ends)
    if (raw == end) return static_cast<std::int64_t>(raw);
  return std::nullopt;
}

bool is_plausible(const ModbusChannel& channel, double temp_degC, const PlausibleRange& range) {
  // While scanning, a float this close to 0 is rather the wrong words than a temperature.
  constexpr double resolved_min = 1e-3;
  const bool is_float =
      channel.encoding == Encoding::float32 || channel.encoding == Encoding::float64;
  const double raw = std::abs((temp_degC - channel.offset_degC) / channel.scale);
  return temp_degC >= range.min_degC && temp_degC <= range.max_degC &&
         may_be_measured(channel, temp_degC) && !(is_float && raw > 0.0 && raw < resolved_min);
}

std::vector<std::string> hints_for_words(const ModbusChannel& channel,
                                         std::span<const std::uint16_t> words,
                                         const PlausibleRange& range) {
  std::vector<std::string> hints;
  hint_codes(channel, words, hints);
  if (!hints.empty()) return hints;
  hint_orders(channel, words, range, hints);
  if (!hints.empty()) return hints;
  hint_halves(channel, words, range, hints);
  hint_scales(channel, words, range, hints);
  return hints;
}

std::vector<std::string> hints_for_address(const ModbusChannel& channel) {
  std::vector<std::string> hints;
  for (const auto& [first, table] :
       {std::pair{30001, ModbusTable::input}, {40001, ModbusTable::holding}}) {
    if (channel.address < first || channel.address >= first + 9999) continue;
    hints.push_back("addresses count from 0 on the wire: " + std::to_string(channel.address) +
                    " in a manual is table = \"" + table_name(table) +
                    "\", address = " + std::to_string(channel.address - first));
  }
  return hints;
}

}  // namespace thermocomp::cli
