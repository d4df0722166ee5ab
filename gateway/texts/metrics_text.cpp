#include "gateway/texts/metrics_text.hpp"

#include <cmath>
#include <initializer_list>
#include <string_view>
#include <utility>

#include "config/text/printable_text.hpp"
#include "status/codes.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

using Labels = std::initializer_list<std::pair<std::string_view, std::string>>;

constexpr double m_per_um = 1e-6;  // rad per urad likewise
constexpr double s_per_us = 1e-6;
constexpr double s_per_ms = 1e-3;
constexpr double bytes_per_MB_decimal = 1e6;

/// Writes metric families; the format requires the samples of a family to be contiguous.
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

  /// NaN (unknown) is left out.
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
  std::string pending_;  ///< header of the family, written before its first sample
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

/// Family with one sample.
void write_gauge(MetricsWriter& out, const char* name, const char* help, double value) {
  out.gauge(name, help);
  out.sample(value);
}

void write_state(MetricsWriter& out, const Status& status) {
  out.gauge("thermocomp_build_info", "1; the label is the daemon's version.");
  out.flag(true, {{"version", status.version}});
  write_gauge(out, "thermocomp_uptime_seconds", "How long the daemon runs.", status.uptime_s);
  write_gauge(out, "thermocomp_compensating",
              "1: offsets reach the machine and every axis is driven.", is_compensating(status));
  write_gauge(out, "thermocomp_enabled", "1: switched on.", status.enabled);
  write_gauge(out, "thermocomp_dry_run", "1: everything is computed, nothing is written.",
              status.dry_run);
  out.gauge("thermocomp_mode", "1 for the mode that the daemon is in, 0 for the others.");
  for (const Mode mode :
       {Mode::starting, Mode::compensating, Mode::holding, Mode::ramping_to_zero, Mode::disabled})
    out.flag(status.mode == mode && !(status.dry_run && mode == Mode::compensating),
             {{"mode", std::string(to_string(mode))}});
  out.flag(status.mode == Mode::compensating && status.dry_run, {{"mode", "dry_run"}});
  write_gauge(out, "thermocomp_mode_duration_seconds", "Time since the last change of mode.",
              status.mode_since_s);
  out.gauge("thermocomp_reason", "1 for each reason not simply to compensate; none: no sample.");
  for (const Reason reason : members_of(status.reasons))
    out.flag(true, {{"reason", std::string(to_string(reason))}});
}

void write_cycle(MetricsWriter& out, const CycleStatus& cycle) {
  out.counter("thermocomp_cycles_total", "Cycles since the daemon's start.");
  out.count(cycle.count);
  out.counter("thermocomp_cycles_missed_total", "Cycles that were skipped because one was late.");
  out.count(cycle.missed);
  out.gauge("thermocomp_cycle_lateness_seconds", "Lateness of the cycle since the start.");
  out.sample(s_per_us * cycle.lateness_us_p50, {{"share", "0.5"}});
  out.sample(s_per_us * cycle.lateness_us_p99, {{"share", "0.99"}});
  out.sample(s_per_us * cycle.lateness_us_p999, {{"share", "0.999"}});
  out.sample(s_per_us * cycle.lateness_us_max, {{"share", "1"}});
  write_gauge(out, "thermocomp_cycle_real_time", "1: the cycle runs with real-time scheduling.",
              cycle.real_time);
}

/// One figure of all axes: [m]; of rotary axes and tilts [rad], under another name.
void write_axis_figure(MetricsWriter& out, const Status& status, const std::string& name,
                       double AxisStatus::*figure, const std::string& help) {
  for (const bool is_angle : {false, true}) {
    out.gauge(name + (is_angle ? "_radians" : "_meters"), help);
    for (const AxisStatus& axis : status.axes)
      if ((axis.unit == "urad") == is_angle)
        out.sample(m_per_um * axis.*figure, {{"axis", axis.name}});
  }
}

void write_axis_flag(MetricsWriter& out, const Status& status, const char* name,
                     bool AxisStatus::*flag, const char* help) {
  out.gauge(name, help);
  for (const AxisStatus& axis : status.axes) out.flag(axis.*flag, {{"axis", axis.name}});
}

void write_axes(MetricsWriter& out, const Status& status) {
  write_axis_figure(out, status, "thermocomp_axis_displacement", &AxisStatus::displacement,
                    "Thermal displacement of the axis, as predicted.");
  write_axis_figure(out, status, "thermocomp_axis_target", &AxisStatus::target,
                    "Offset that is aimed at.");
  write_axis_figure(out, status, "thermocomp_axis_offset", &AxisStatus::offset,
                    "Offset that is sent.");
  write_axis_figure(out, status, "thermocomp_axis_applied", &AxisStatus::applied,
                    "Offset that the controller reads back.");
  if (status.probe_due) {
    out.gauge("thermocomp_axis_probing_due", "1: it is time to probe the axis.");
    for (const auto& [axis, due] : status.probe_due->axes) out.flag(due, {{"axis", axis}});
  }
  out.gauge("thermocomp_axis_warm_seconds",
            "Time until less than compensation.warm_um remains; 0: warm, none: unknown.");
  for (const auto& [axis, warm] : status.warm)
    if (std::isfinite(warm.minutes)) out.sample(60.0 * warm.minutes, {{"axis", axis}});
  write_axis_flag(out, status, "thermocomp_axis_driven", &AxisStatus::driven,
                  "1: offsets are written to the axis.");
  write_axis_flag(out, status, "thermocomp_axis_at_bound", &AxisStatus::at_bound,
                  "1: the target is beyond the bound.");
  write_axis_flag(out, status, "thermocomp_axis_disagrees", &AxisStatus::disagrees,
                  "1: the read-back differs from the offset sent.");
}

std::string blocks_of(const SensorStatus& sensor) {
  std::string blocks;
  for (const std::string& block : sensor.blocks)
    blocks.append(blocks.empty() ? "" : ",").append(block);
  return blocks;
}

void write_sensors(MetricsWriter& out, const std::vector<SensorStatus>& sensors) {
  const auto each = [&](double (*figure)(const SensorStatus&)) {
    for (const SensorStatus& sensor : sensors)
      out.sample(figure(sensor), {{"sensor", sensor.name}, {"block", blocks_of(sensor)}});
  };
  out.gauge("thermocomp_sensor_temperature_celsius", "Temperature, smoothed.");
  each([](const SensorStatus& sensor) { return sensor.smoothed_degC; });
  out.gauge("thermocomp_sensor_raw_temperature_celsius", "Temperature as read.");
  each([](const SensorStatus& sensor) { return sensor.raw_degC; });
  out.gauge("thermocomp_sensor_good", "1: the sensor has no fault.");
  each([](const SensorStatus& sensor) { return sensor.fault == Fault::none ? 1.0 : 0.0; });
  out.gauge("thermocomp_sensor_suspected", "1: the sensor drifts away from its neighbours.");
  each([](const SensorStatus& sensor) { return sensor.suspected ? 1.0 : 0.0; });
  out.gauge("thermocomp_sensor_age_seconds", "Age of the sensor's last reading.");
  each([](const SensorStatus& sensor) { return sensor.age_s; });
  out.counter("thermocomp_sensor_rejected_total", "Readings that cannot be true.");
  each([](const SensorStatus& sensor) { return static_cast<double>(sensor.rejected); });
}

void write_buses(MetricsWriter& out, const std::vector<BusStatus>& buses) {
  out.gauge("thermocomp_bus_connected", "1: the bus is connected.");
  for (const BusStatus& bus : buses)
    out.flag(bus.connected, {{"bus", bus.name}, {"kind", bus.kind}});
  const auto each = [&](double (*figure)(const UnitStatus&)) {
    for (const BusStatus& bus : buses)
      for (const UnitStatus& unit : bus.units)
        out.sample(figure(unit), {{"bus", bus.name}, {"unit", unit.name}});
  };
  const auto counted = [&](const char* name, const char* help,
                           double (*figure)(const UnitStatus&)) {
    out.counter(name, help);
    each(figure);
  };
  out.gauge("thermocomp_unit_answering", "1: the unit on the bus answers.");
  each([](const UnitStatus& unit) { return unit.answering ? 1.0 : 0.0; });
  counted("thermocomp_unit_requests_total", "Requests to the unit.",
          [](const UnitStatus& unit) { return static_cast<double>(unit.requests); });
  counted("thermocomp_unit_answers_total", "Answers of the unit.",
          [](const UnitStatus& unit) { return static_cast<double>(unit.answers); });
  counted("thermocomp_unit_timeouts_total", "Requests without an answer in time.",
          [](const UnitStatus& unit) { return static_cast<double>(unit.timeouts); });
  counted("thermocomp_unit_exceptions_total", "Answers that are an exception.",
          [](const UnitStatus& unit) { return static_cast<double>(unit.exceptions); });
  counted("thermocomp_unit_bad_frames_total", "Answers that were garbled.",
          [](const UnitStatus& unit) { return static_cast<double>(unit.bad_frames); });
  out.gauge("thermocomp_unit_round_trip_seconds", "Time from a request to its answer.");
  each([](const UnitStatus& unit) { return s_per_ms * unit.round_trip_ms; });
}

void write_rest(MetricsWriter& out, const Status& status) {
  const ControllerStatus& controller = status.controller;
  out.gauge("thermocomp_controller_online", "1: the controller answers.");
  out.flag(controller.online, {{"controller", controller.name}});
  out.counter("thermocomp_controller_refused_writes_total",
              "Writes of offsets that the controller answered with an exception.");
  out.count(controller.write.refused, {{"controller", controller.name}});
  out.counter("thermocomp_controller_unanswered_writes_total",
              "Writes of offsets without an answer in time.");
  out.count(controller.write.unanswered, {{"controller", controller.name}});
  if (status.model.outside) {
    write_gauge(out, "thermocomp_model_outside_domain",
                "1: the machine is outside the domain of its model.", *status.model.outside);
    write_gauge(out, "thermocomp_model_outside_domain_ratio", "Share of the last 24 h outside.",
                status.model.outside_share_24h);
  }
  if (status.candidate && status.candidate->problem.empty()) {
    write_gauge(out, "thermocomp_candidate_better_ratio",
                "Probability that the candidate is the better model.",
                status.candidate->better_probability);
    out.gauge("thermocomp_candidate_probings", "Probings that scored the candidate.");
    out.count(status.candidate->probings);
  }
  const HistoryStatus& history = status.history;
  if (!history.enabled) return;
  write_gauge(out, "thermocomp_history_working", "1: the history is written.", history.working);
  write_gauge(out, "thermocomp_history_size_bytes", "Size of the history.",
              bytes_per_MB_decimal * history.size_MB);
  out.counter("thermocomp_history_lost_records_total", "Records that could not be written.");
  out.count(history.lost_records);
}

}  // namespace

std::string metrics_text(const Snapshot& snapshot, const GatewayFigures& figures) {
  MetricsWriter out;
  out.gauge("thermocomp_up", "1: the daemon answers the gateway.");
  out.flag(snapshot.is_here);
  write_gateway(out, figures);
  if (snapshot.is_here) {
    write_state(out, snapshot.status);
    write_cycle(out, snapshot.status.cycle);
    write_axes(out, snapshot.status);
    write_sensors(out, snapshot.sensors.sensors);
    write_buses(out, snapshot.status.buses);
    write_rest(out, snapshot.status);
  }
  return out.take();
}

}  // namespace thermocomp::gateway
