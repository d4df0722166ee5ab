#include "status/verdict.hpp"

#include <algorithm>
#include <functional>

#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp {

namespace {

/// The operator's switch outlives the dry run: left on, the first offsets go out unwatched.
constexpr std::string_view dry_run_remedy =
    "thermocomp enable shows the offsets; thermocomp disable before the dry run ends";
constexpr std::string_view bus_off_remedy =
    "cable, termination, bit rate; then ip link set IF type can restart, or let restart-ms do it";
constexpr std::string_view can_remedy = "cable, termination, bit rate";

constexpr std::string_view unit_remedy = "thermocomp scan shows what came and tries what may help";

using AddTrouble = std::function<void(const std::string& what, std::string_view remedy)>;

bool is_network(std::string_view kind) {
  return kind.starts_with("modbus") && kind != "modbus_rtu";
}

std::vector<std::string> axes_not_driven(const Status& status) {
  std::vector<std::string> names;
  for (const AxisStatus& axis : status.axes)
    if (!axis.driven) names.push_back(axis.name);
  return names;
}

/// @param state_s  how long the CAN interface has been in `state`
void add_can_trouble(const std::string& name, const std::optional<std::string>& state,
                     std::optional<double> state_s, const AddTrouble& add) {
  const std::string lasts = " for " + duration_text(state_s.value_or(not_a_number));
  if (state == "bus_off") add(name + ": bus-off" + lasts, bus_off_remedy);
  if (state == "passive" || state == "warning") add(name + ": error " + *state + lasts, can_remedy);
}

void add_bus_troubles(const Status& status, const AddTrouble& add) {
  for (const BusStatus& bus : status.buses) {
    const std::string name = "bus " + bus.name;
    for (const UnitStatus& unit : bus.units)
      if (unit.answering && !unit.last_error.empty() && !status.sensors_bad.empty()) {
        add(name + ": " + unit.name + ": " + unit.last_error, unit_remedy);
      } else if (!unit.answering && bus.connected) {
        const bool is_silent = unit.timeouts >= unit.bad_frames;
        add(name + ": " + unit.name + (is_silent ? " does not answer (" : " answers wrongly (") +
                unit.last_error + ")",
            is_network(bus.kind) && !is_silent
                ? unit_remedy
                : code_text(is_silent ? Fault::no_answer : Fault::bad_frame).remedy);
      }
    add_can_trouble(name, bus.state, bus.state_s, add);
    if (!bus.connected && bus.state != "bus_off")
      add(name + " is not connected (" + bus.last_error + ")", bus_remedy(bus.kind));
  }
}

void add_reasons(const Status& status, const AddTrouble& add) {
  for (const Reason reason : by_severity(status.reasons)) {
    // Signals come from the controller: where that is offline, it is the cause.
    if (reason == Reason::signal_lost && has_reason(status.reasons, Reason::controller_offline))
      continue;
    const CodeText text = code_text(reason);
    const std::string& error = status.controller.last_error;
    const bool is_of_link = reason == Reason::not_written || reason == Reason::controller_offline;
    const bool has_error = is_of_link && !error.empty();
    const bool switched_off = reason == Reason::operator_disabled && status.dry_run;
    add(std::string(text.meaning) + (has_error ? ": " + error : ""),
        switched_off ? dry_run_remedy : text.remedy);
  }
}

/// What is wrong while the machine is compensated all the same.
void add_degradations(const Status& status, std::vector<std::string>& why) {
  for (const AxisStatus& axis : status.axes) {
    if (axis.at_bound) why.push_back("axis " + axis.name + " is at its bound");
    if (axis.disagrees) why.push_back("axis " + axis.name + ": the read-back disagrees");
  }
  for (const std::string& sensor : status.sensors_bad)
    why.push_back("sensor " + sensor + " is bad");
  for (const BusStatus& bus : status.buses) {
    if (!bus.connected) why.push_back("bus " + bus.name + " is not connected");
    for (const UnitStatus& unit : bus.units)
      if (!unit.answering) why.push_back("bus " + bus.name + ": " + unit.name + " is silent");
  }
  if (status.history.enabled && !status.history.working)
    why.emplace_back("the history is not written");
}

}  // namespace

bool is_compensating(const Status& status) {
  return status.mode == Mode::compensating && !status.dry_run && axes_not_driven(status).empty() &&
         !has_reason(status.reasons, Reason::controller_offline);
}

Verdict verdict(const Status& status) {
  const std::string words = std::string(code_text(status.mode, false).meaning) + ", for " +
                            duration_text(status.mode_since_s);
  if (status.dry_run) {
    const std::string does =
        status.mode == Mode::compensating
            ? "all is read and computed, for " + duration_text(status.mode_since_s)
            : words;
    return {false, true, "no: DRY RUN", "nothing is written to the controller (" + does + ")"};
  }
  if (is_compensating(status))
    return {true, true, "yes", "for " + duration_text(status.compensating_s)};
  if (status.mode == Mode::compensating) {
    const auto idle = axes_not_driven(status);
    return {false, false, "no",
            idle.empty() ? "the controller takes no offsets" : "axes not driven: " + joined(idle)};
  }
  return {false, status.mode == Mode::disabled, "no", words};
}

std::string verdict_text(const Verdict& verdict) {
  return verdict.answer == "no" ? "no (" + verdict.detail + ")"
                                : verdict.answer + ", " + verdict.detail;
}

std::vector<std::string> why_not(const Status& status, bool strict) {
  std::vector<std::string> why;
  const bool compensating = is_compensating(status);
  if (!compensating) {
    if (status.dry_run) why.emplace_back("dry run: nothing is written");
    if (status.mode != Mode::compensating || status.dry_run)
      why.push_back("mode " + std::string(code_text(status.mode, status.dry_run).name));
    for (const std::string& axis : axes_not_driven(status))
      why.push_back("axis " + axis + " is not driven");
  }
  for (const Reason reason : members_of(status.reasons)) {
    const Severity severity = code_text(reason).severity;
    const bool counts = !compensating || strict || severity == Severity::fault;
    if (counts && severity != Severity::normal) why.emplace_back(to_string(reason));
  }
  if (strict) add_degradations(status, why);
  return why;
}

std::vector<Trouble> troubles(const Status& status) {
  std::vector<Trouble> list;
  const auto add = [&list](const std::string& what, std::string_view remedy) {
    list.push_back({what, std::string(remedy)});
  };
  add_reasons(status, add);
  for (const std::string& estimate : estimate_lines(status.inputs, status.axes)) add(estimate, "");
  if (!status.sensors_bad.empty())
    add("bad sensors: " + joined(status.sensors_bad), "thermocomp sensors says why");
  for (const JumpedSensor& sensor : status.sensors_jumped)
    add("sensor " + sensor.name + " jumped by " + fixed_signed(sensor.jump.size_K, 1) + " K",
        "where that is right: thermocomp accept " + sensor.name);
  for (const SuspectedSensor& sensor : status.sensors_suspected)
    add("sensor " + sensor.name + " is " + suspicion_text(sensor.suspicion), "");
  add_bus_troubles(status, add);
  add_can_trouble("controller " + status.controller.name, status.controller.state,
                  status.controller.state_s, add);
  for (const std::string& warning : status.warnings) add(warning, "");
  return list;
}

std::vector<std::string> estimate_lines(const std::vector<InputStatus>& inputs,
                                        const std::vector<AxisStatus>& axes) {
  std::vector<std::string> lines;
  const auto measured = std::count_if(inputs.begin(), inputs.end(),
                                      [](const InputStatus& input) { return input.good; });
  for (const InputStatus& input : inputs)
    if (input.estimated)
      lines.push_back("block " + input.block + " is estimated from " + std::to_string(measured) +
                      (measured == 1 ? " other" : " others") + ", +-" + fixed(input.sd_K, 2) +
                      " K (1 sd)");
  if (lines.empty()) return lines;
  std::vector<std::string> offsets;
  for (const AxisStatus& axis : axes)
    offsets.push_back(axis.name + " +-" + fixed(axis.offset_sd, 2) + " " + axis.unit +
                      (axis.offset_sd > axis.offset_sd_max
                           ? " (too uncertain: at most " + fixed(axis.offset_sd_max, 2) + ")"
                           : ""));
  lines.push_back("this makes the offsets uncertain by (1 sd): " + joined(offsets));
  return lines;
}

std::string suspicion_text(const SensorError& suspected) {
  return "off by " + fixed_signed(suspected.size_K, 1) + " K against its neighbours since " +
         local_time(suspected.since) +
         (suspected.weighed_down ? ", not used" : ", used all the same");
}

std::string write_text(const WriteStatus& write) {
  if (write.refused + write.unanswered == 0) return {};
  const auto named = [](const char* name, const std::optional<std::uint64_t>& number) {
    return number ? name + std::to_string(*number) : std::string();
  };
  const std::string how = (write.exception ? "refused" : "unanswered") +
                          named(", function ", write.function) +
                          named(", address ", write.address) +
                          named(write.function ? ", exception " : ", S7 code ", write.exception);
  return "writes " + how + "; last confirmed " +
         (write.last_confirmed_s >= 0.0 ? duration_text(write.last_confirmed_s) + " ago" : "never");
}

std::string_view bus_remedy(std::string_view kind) {
  if (is_network(kind)) return "check the module's power, cable, address and port";
  if (kind == "modbus_rtu") return "check that the adapter is plugged in and is the `device` named";
  return "check the interface (ip -details link show) and its cable";
}

}  // namespace thermocomp
