#include "gateway/texts/shdr_text.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "gateway/texts/mqtt_texts.hpp"
#include "status/codes.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

constexpr const char* unavailable = "UNAVAILABLE";
constexpr const char* normal = "NORMAL||||";
constexpr double mm_per_um = 1e-3;
constexpr double deg_per_urad = 180.0 / std::numbers::pi * 1e-6;

std::string number(double value) {
  if (!std::isfinite(value)) return unavailable;
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.6f", value);
  return text.data();
}

/// Replaces `|` and control characters, which delimit fields and entries.
std::string plain(std::string_view text) {
  std::string made;
  for (const char c : text) {
    const bool is_control = static_cast<unsigned char>(c) < ' ' || c == 127;
    made += is_control ? ' ' : c == '|' ? '/' : c;
  }
  return made;
}

std::string condition(const char* level, std::string_view code, std::string_view text) {
  return std::string(level) + "|" + plain(code) + "|||" + plain(text);
}

bool is_condition(const std::string& item) {
  return item == "system" || item.starts_with("sensor_") || item.starts_with("bus_");
}

/// FAULT: not compensated but should be. WARNING: compensated, or off on purpose, with a problem.
std::vector<std::string> system_condition(const Status& status) {
  const Verdict now = verdict(status);
  const bool is_fault = !now.compensating && !now.intended;
  const char* level = is_fault ? "FAULT" : "WARNING";
  std::vector<std::string> entries;
  for (const Reason reason : by_severity(status.reasons)) {
    const CodeText text = code_text(reason);
    if (text.severity != Severity::normal)
      entries.push_back(condition(level, text.name, text.meaning));
  }
  if (entries.empty() && is_fault)
    entries.push_back(
        condition(level, code_text(status.mode, status.dry_run).name, verdict_text(now)));
  if (entries.empty()) entries.emplace_back(normal);
  return entries;
}

std::string sensor_condition(const SensorStatus& sensor) {
  const CodeText fault = fault_text(sensor);
  if (sensor.fault != Fault::none)
    return condition(settles(sensor) ? "WARNING" : "FAULT", fault.name, fault.meaning);
  if (sensor.suspected) return condition("WARNING", "suspected", "off against its neighbours");
  return normal;
}

void add_sensors(const SensorsAnswer& answer, ShdrStates& states) {
  for (const SensorStatus& sensor : answer.sensors) {
    const bool is_good = sensor.fault == Fault::none;
    states[item_name("temp", sensor.name)] = {is_good ? number(sensor.smoothed_degC) : unavailable};
    states[item_name("sensor", sensor.name)] = {sensor_condition(sensor)};
  }
}

/// Data item in the device file.
struct ItemKind {
  const char* category;
  const char* type;
  const char* units;  ///< empty: none
};

void append_item(std::string& xml, const ItemKind& kind, const std::string& name) {
  xml.append("        <DataItem category=\"").append(kind.category).append("\" id=\"");
  xml.append(name).append("\" name=\"").append(name).append("\" type=\"").append(kind.type);
  if (*kind.units != '\0') xml.append("\" units=\"").append(kind.units);
  xml.append("\"/>\n");
}

constexpr ItemKind condition_item{"CONDITION", "SYSTEM", ""};

}  // namespace

std::string item_name(const std::string& kind, const std::string& name) {
  return kind + "_" + distinct_name(name, [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '_';
         });
}

ShdrStates shdr_states(const Snapshot& snapshot) {
  ShdrStates states;
  states["avail"] = {snapshot.is_here ? "AVAILABLE" : unavailable};
  const Status& status = snapshot.status;
  states["mode"] = {plain(code_text(status.mode, status.dry_run).name)};
  states["system"] = system_condition(status);
  add_sensors(snapshot.sensors, states);
  for (const AxisStatus& axis : status.axes) {
    const double factor = axis.unit == "urad" ? deg_per_urad : mm_per_um;
    states[item_name("offset", axis.name)] = {number(factor * axis.offset)};
    states[item_name("displacement", axis.name)] = {number(factor * axis.displacement)};
  }
  for (const BusStatus& bus : status.buses)
    states[item_name("bus", bus.name)] = {
        bus.connected ? normal : condition("FAULT", "away", bus.last_error)};
  if (snapshot.is_here) return states;
  for (auto& [item, entries] : states) entries = {unavailable};
  states["system"] = {condition("FAULT", "daemon", "the daemon does not answer")};
  return states;
}

std::string shdr_lines(const ShdrStates& before, const ShdrStates& now, double wall_s) {
  const std::string time = utc_text(wall_s);
  std::string values;
  std::string lines;
  const auto add_entries = [&](const std::string& item, const std::vector<std::string>& entries) {
    if (!is_condition(item)) {
      values.append("|").append(item).append("|").append(entries.front());
      return;
    }
    // NORMAL without a code clears all active entries; then follow the current ones.
    const bool is_plain =
        entries.size() == 1 && (entries[0] == normal || entries[0] == unavailable);
    const auto line = [&](const std::string& entry) {
      lines.append(time).append("|").append(item).append("|").append(entry).append("\n");
    };
    if (!is_plain) line(normal);
    for (const std::string& entry : entries) line(entry == unavailable ? "UNAVAILABLE||||" : entry);
  };
  for (const auto& [item, entries] : now) {
    const auto known = before.find(item);
    if (known == before.end() || known->second != entries) add_entries(item, entries);
  }
  for (const auto& [item, entries] : before)
    if (now.count(item) == 0) add_entries(item, {unavailable});
  return (values.empty() ? "" : time + values + "\n") + lines;
}

std::string shdr_answer(std::string_view line, double heartbeat_s) {
  constexpr double ms_per_s = 1000.0;
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  if (line != "* PING") return {};
  return "* PONG " + std::to_string(static_cast<int>(ms_per_s * heartbeat_s)) + "\n";
}

std::string device_file(const Snapshot& snapshot, const std::string& machine) {
  std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<MTConnectDevices xmlns=\"urn:mtconnect.org:MTConnectDevices:1.8\"\n"
      "  xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\"\n"
      "  xsi:schemaLocation=\"urn:mtconnect.org:MTConnectDevices:1.8 "
      "http://schemas.mtconnect.org/schemas/MTConnectDevices_1.8.xsd\">\n"
      "  <Header bufferSize=\"131072\" instanceId=\"1\" sender=\"localhost\" version=\"1.8\"\n"
      "    assetBufferSize=\"1024\" assetCount=\"0\" creationTime=\"" +
      utc_text(snapshot.wall_s) + "\"/>\n  <Devices>\n    <Device id=\"" +
      item_name("thermocomp", machine) + "\" name=\"" + machine + "\" uuid=\"thermocomp-" +
      machine + "\">\n      <Description>thermal compensation</Description>\n      <DataItems>\n";
  append_item(xml, {"EVENT", "AVAILABILITY", ""}, "avail");
  append_item(xml, {"EVENT", "VARIABLE", ""}, "mode");
  append_item(xml, condition_item, "system");
  for (const SensorStatus& sensor : snapshot.sensors.sensors) {
    append_item(xml, {"SAMPLE", "TEMPERATURE", "CELSIUS"}, item_name("temp", sensor.name));
    append_item(xml, condition_item, item_name("sensor", sensor.name));
  }
  for (const AxisStatus& axis : snapshot.status.axes) {
    const ItemKind kind = axis.unit == "urad" ? ItemKind{"SAMPLE", "ANGLE", "DEGREE"}
                                              : ItemKind{"SAMPLE", "DISPLACEMENT", "MILLIMETER"};
    append_item(xml, kind, item_name("offset", axis.name));
    append_item(xml, kind, item_name("displacement", axis.name));
  }
  for (const BusStatus& bus : snapshot.status.buses)
    append_item(xml, {"CONDITION", "COMMUNICATIONS", ""}, item_name("bus", bus.name));
  return xml + "      </DataItems>\n    </Device>\n  </Devices>\n</MTConnectDevices>\n";
}

}  // namespace thermocomp::gateway
