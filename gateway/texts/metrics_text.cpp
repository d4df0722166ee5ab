#include "gateway/texts/metrics_text.hpp"

#include <array>
#include <cmath>
#include <initializer_list>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/observe/troubles.hpp"
#include "config/text/number_text.hpp"

namespace thermocomp::gateway {
namespace {

using cli::count_of;
using cli::flag_of;
using cli::list_of;
using cli::number_of;
using cli::object_of;
using cli::text_of;
using nlohmann::json;

using Labels = std::initializer_list<std::pair<std::string_view, std::string>>;

constexpr double m_per_um = 1e-6;  // also rad per urad
constexpr double s_per_us = 1e-6;
constexpr double s_per_ms = 1e-3;
constexpr double bytes_per_MB_decimal = 1e6;

/// Writes families one after the other; a family's samples stand together, as the format wants.
class MetricsWriter {
 public:
  void family(std::string_view name, std::string_view kind, std::string_view help) {
    name_ = name;
    pending_.clear();
    pending_.append("# HELP ").append(name).append(" ").append(help).append("\n# TYPE ");
    pending_.append(name).append(" ").append(kind).append("\n");
  }
  void gauge(std::string_view name, std::string_view help) { family(name, "gauge", help); }
  void counter(std::string_view name, std::string_view help) { family(name, "counter", help); }

  /// NaN is left out: not known is no number.
  void sample(double value, Labels labels = {}) {
    if (!std::isfinite(value)) return;
    text_ += pending_;
    pending_.clear();
    text_ += name_;
    bool is_first = true;
    for (const auto& [label, content] : labels) {
      text_.append(is_first ? "{" : ",").append(label).append("=\"");
      append_escaped(content);
      text_ += '"';
      is_first = false;
    }
    if (!is_first) text_ += '}';
    text_ += ' ';
    append_number(text_, value);
    text_ += '\n';
  }
  void count(std::uint64_t value, Labels labels = {}) {
    sample(static_cast<double>(value), labels);
  }
  void flag(bool value, Labels labels = {}) { sample(value ? 1.0 : 0.0, labels); }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  void append_escaped(const std::string& content) {
    for (const char c : content) {
      if (c == '\n') {
        text_ += "\\n";
        continue;
      }
      if (c == '\\' || c == '"') text_ += '\\';
      text_ += c;
    }
  }

  std::string name_;
  std::string pending_;  ///< head of the family; written before its first sample
  std::string text_;
};

void write_gateway(MetricsWriter& out, const GatewayFigures& figures) {
  out.gauge("thermocomp_gateway_pages", "Open pages.");
  out.count(figures.pages);
  out.counter("thermocomp_gateway_requests_total", "HTTP requests answered.");
  out.count(figures.requests);
  out.counter("thermocomp_gateway_refused_requests_total", "HTTP requests refused by a rule.");
  out.count(figures.refused);
  if (!figures.mqtt_enabled) return;
  out.gauge("thermocomp_gateway_mqtt_connected", "1: the MQTT broker is connected.");
  out.flag(figures.mqtt_connected);
  out.counter("thermocomp_gateway_mqtt_dropped_total",
              "MQTT messages that were dropped, the oldest first, while the broker was away.");
  out.count(figures.mqtt_dropped);
}

void write_state(MetricsWriter& out, const json& status) {
  out.gauge("thermocomp_build_info", "1; the label is the daemon's version.");
  out.flag(true, {{"version", text_of(status, "version")}});
  out.gauge("thermocomp_uptime_seconds", "How long the daemon runs.");
  out.sample(number_of(status, "uptime_s"));
  out.gauge("thermocomp_compensating", "1: offsets reach the machine and every axis is driven.");
  out.flag(cli::is_compensating(status));
  out.gauge("thermocomp_enabled", "1: switched on.");
  out.flag(flag_of(status, "enabled"));
  out.gauge("thermocomp_dry_run", "1: everything is computed, nothing is written.");
  out.flag(flag_of(status, "dry_run"));
  out.gauge("thermocomp_mode", "1 for the mode that the daemon is in, 0 for the others.");
  constexpr std::array<const char*, 6> modes{"starting",        "compensating", "holding",
                                             "ramping_to_zero", "disabled",     "dry_run"};
  for (const char* mode : modes) out.flag(text_of(status, "mode") == mode, {{"mode", mode}});
  out.gauge("thermocomp_mode_duration_seconds", "How long it has been in its mode.");
  out.sample(number_of(status, "mode_since_s"));
  out.gauge("thermocomp_reason", "1 for each reason not simply to compensate; none: no sample.");
  for (const json& reason : list_of(status, "reasons"))
    if (reason.is_string()) out.flag(true, {{"reason", reason.get<std::string>()}});
}

void write_cycle(MetricsWriter& out, const json& cycle) {
  out.counter("thermocomp_cycles_total", "Cycles since the daemon's start.");
  out.count(count_of(cycle, "count"));
  out.counter("thermocomp_cycles_missed_total", "Cycles that were skipped because one was late.");
  out.count(count_of(cycle, "missed"));
  out.gauge("thermocomp_cycle_lateness_seconds", "Lateness of the cycle since the start.");
  const std::array<std::pair<const char*, const char*>, 4> shares{{{"0.5", "lateness_us_p50"},
                                                                   {"0.99", "lateness_us_p99"},
                                                                   {"0.999", "lateness_us_p999"},
                                                                   {"1", "lateness_us_max"}}};
  for (const auto& [share, key] : shares)
    out.sample(s_per_us * number_of(cycle, key), {{"share", share}});
  out.gauge("thermocomp_cycle_real_time", "1: the cycle runs with real-time scheduling.");
  out.flag(flag_of(cycle, "real_time"));
}

/// A figure of all axes: lengths in meters; of rotary axes and tilts in radians, by another name.
void write_axis_figure(MetricsWriter& out, const json& status, const std::string& name,
                       const char* key, const std::string& help) {
  for (const bool is_angle : {false, true}) {
    out.gauge(name + (is_angle ? "_radians" : "_meters"), help);
    for (const json& axis : list_of(status, "axes"))
      if ((text_of(axis, "unit") == "urad") == is_angle)
        out.sample(m_per_um * number_of(axis, key), {{"axis", text_of(axis, "name")}});
  }
}

void write_axes(MetricsWriter& out, const json& status) {
  write_axis_figure(out, status, "thermocomp_axis_displacement", "displacement",
                    "Thermal displacement of the axis, as predicted.");
  write_axis_figure(out, status, "thermocomp_axis_target", "target", "Offset that is aimed at.");
  write_axis_figure(out, status, "thermocomp_axis_offset", "offset", "Offset that is sent.");
  write_axis_figure(out, status, "thermocomp_axis_applied", "applied",
                    "Offset that the controller reads back.");
  const std::array<std::array<const char*, 3>, 3> flags{
      {{"thermocomp_axis_driven", "driven", "1: offsets are written to the axis."},
       {"thermocomp_axis_at_bound", "at_bound", "1: the target is beyond the bound."},
       {"thermocomp_axis_disagrees", "disagrees", "1: the read-back differs from what is sent."}}};
  for (const auto& [name, key, help] : flags) {
    out.gauge(name, help);
    for (const json& axis : list_of(status, "axes"))
      out.flag(flag_of(axis, key), {{"axis", text_of(axis, "name")}});
  }
}

std::string block_of(const json& sensor) {
  std::string blocks;
  for (const json& block : list_of(sensor, "blocks"))
    if (block.is_string())
      blocks.append(blocks.empty() ? "" : ",").append(block.get<std::string>());
  return blocks;
}

void write_sensors(MetricsWriter& out, const json& sensors) {
  const json& list = list_of(sensors, "sensors");
  const auto each = [&](auto&& write) {
    for (const json& sensor : list) write(sensor, text_of(sensor, "name"), block_of(sensor));
  };
  out.gauge("thermocomp_sensor_temperature_celsius", "Temperature, smoothed.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.sample(number_of(sensor, "smoothed_degC"), {{"sensor", name}, {"block", block}});
  });
  out.gauge("thermocomp_sensor_raw_temperature_celsius", "Temperature as read.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.sample(number_of(sensor, "raw_degC"), {{"sensor", name}, {"block", block}});
  });
  out.gauge("thermocomp_sensor_good", "1: the sensor has no fault.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.flag(text_of(sensor, "fault") == "none", {{"sensor", name}, {"block", block}});
  });
  out.gauge("thermocomp_sensor_suspected", "1: the sensor drifts away from its neighbours.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.flag(!object_of(sensor, "suspected").empty(), {{"sensor", name}, {"block", block}});
  });
  out.gauge("thermocomp_sensor_age_seconds", "Age of the sensor's last reading.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.sample(number_of(sensor, "age_s"), {{"sensor", name}, {"block", block}});
  });
  out.counter("thermocomp_sensor_rejected_total", "Readings that cannot be true.");
  each([&](const json& sensor, const std::string& name, const std::string& block) {
    out.count(count_of(sensor, "rejected"), {{"sensor", name}, {"block", block}});
  });
}

void write_buses(MetricsWriter& out, const json& status) {
  const json& buses = list_of(status, "buses");
  out.gauge("thermocomp_bus_connected", "1: the bus is connected.");
  for (const json& bus : buses)
    out.flag(flag_of(bus, "connected"),
             {{"bus", text_of(bus, "name")}, {"kind", text_of(bus, "kind")}});
  const auto each = [&](auto&& write) {
    for (const json& bus : buses)
      for (const json& unit : list_of(bus, "units"))
        write(unit, text_of(bus, "name"), text_of(unit, "name"));
  };
  out.gauge("thermocomp_unit_answering", "1: the unit on the bus answers.");
  each([&](const json& unit, const std::string& bus, const std::string& name) {
    out.flag(flag_of(unit, "answering"), {{"bus", bus}, {"unit", name}});
  });
  const std::array<std::array<const char*, 3>, 5> counters{
      {{"thermocomp_unit_requests_total", "requests", "Requests to the unit."},
       {"thermocomp_unit_answers_total", "answers", "Answers of the unit."},
       {"thermocomp_unit_timeouts_total", "timeouts", "Requests without an answer in time."},
       {"thermocomp_unit_exceptions_total", "exceptions", "Answers that are an exception."},
       {"thermocomp_unit_bad_frames_total", "bad_frames", "Answers that were garbled."}}};
  for (const auto& [family, key, help] : counters) {
    out.counter(family, help);
    each([&, name_of_key = key](const json& unit, const std::string& bus, const std::string& name) {
      out.count(count_of(unit, name_of_key), {{"bus", bus}, {"unit", name}});
    });
  }
  out.gauge("thermocomp_unit_round_trip_seconds", "Time from a request to its answer.");
  each([&](const json& unit, const std::string& bus, const std::string& name) {
    out.sample(s_per_ms * number_of(unit, "round_trip_ms"), {{"bus", bus}, {"unit", name}});
  });
}

void write_rest(MetricsWriter& out, const json& status) {
  const json& controller = object_of(status, "controller");
  out.gauge("thermocomp_controller_online", "1: the controller answers.");
  out.flag(flag_of(controller, "online"), {{"controller", text_of(controller, "name")}});
  const json& model = object_of(status, "model");
  if (model.contains("outside") && model["outside"].is_boolean()) {
    out.gauge("thermocomp_model_outside_domain",
              "1: the machine is outside of what its model was made from.");
    out.flag(flag_of(model, "outside"));
    out.gauge("thermocomp_model_outside_domain_ratio", "Share of the last 24 h outside.");
    out.sample(number_of(model, "outside_share_24h"));
  }
  const json& history = object_of(status, "history");
  if (!flag_of(history, "enabled")) return;
  out.gauge("thermocomp_history_working", "1: the history is written.");
  out.flag(flag_of(history, "working"));
  out.gauge("thermocomp_history_size_bytes", "Size of the history.");
  out.sample(bytes_per_MB_decimal * number_of(history, "size_MB"));
  out.counter("thermocomp_history_lost_records_total", "Records that could not be written.");
  out.count(count_of(history, "lost_records"));
}

}  // namespace

std::string metrics_text(const Snapshot& snapshot, const GatewayFigures& figures) {
  MetricsWriter out;
  out.gauge("thermocomp_up", "1: the daemon answers the gateway.");
  out.flag(snapshot.is_here);
  write_gateway(out, figures);
  if (snapshot.is_here) {
    write_state(out, snapshot.status);
    write_cycle(out, object_of(snapshot.status, "cycle"));
    write_axes(out, snapshot.status);
    write_sensors(out, snapshot.sensors);
    write_buses(out, snapshot.status);
    write_rest(out, snapshot.status);
  }
  return out.take();
}

}  // namespace thermocomp::gateway
