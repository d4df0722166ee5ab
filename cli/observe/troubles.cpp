#include "cli/observe/troubles.hpp"

#include <algorithm>
#include <functional>
#include <string_view>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/observe/events_text.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;

std::string mode_words(const std::string& mode) {
  if (mode == "starting") return "starting: waiting for the first good values";
  if (mode == "disabled") return "switched off: offsets at or on the way to zero";
  if (mode == "holding") return "data lost: holding the last offsets";
  if (mode == "ramping_to_zero") return "data lost: offsets on the way to zero";
  return mode;
}

// What a CAN interface says of itself, where that is trouble; `what` is a bus or the controller.
std::string can_trouble(const json& what) {
  const std::string state = text_of(what, "state");
  const std::string since = " for " + duration_text(number_of(what, "state_s"));
  if (state == "bus_off") return "bus-off" + since;
  if (state == "passive") return "error passive" + since;
  if (state == "warning") return "error warning" + since;
  return {};
}

constexpr std::string_view bus_off_remedy =
    "cable, termination, bit rate; then ip link set IF type can restart, or let restart-ms do it";
constexpr std::string_view can_remedy = "cable, termination, bit rate";

/// The switch outlives the dry run: left on, the first offsets go out unwatched.
constexpr std::string_view dry_run_remedy =
    "thermocomp enable shows the offsets; thermocomp disable before the dry run ends";

using AddTrouble = std::function<void(const std::string& what, std::string_view remedy)>;

void add_can_trouble(const std::string& name, const json& what, const AddTrouble& add) {
  const std::string trouble = can_trouble(what);
  if (trouble.empty()) return;
  add(name + ": " + trouble, text_of(what, "state") == "bus_off" ? bus_off_remedy : can_remedy);
}

void add_bus_troubles(const json& status, const AddTrouble& add) {
  for (const json& bus : list_of(status, "buses")) {
    const std::string name = "bus " + text_of(bus, "name");
    for (const json& unit : list_of(bus, "units")) {
      if (flag_of(unit, "answering") || !flag_of(bus, "connected")) continue;
      add(name + ": " + text_of(unit, "name") + " does not answer (" + text_of(unit, "last_error") +
              ")",
          fault_text("no_answer").remedy);
    }
    add_can_trouble(name, bus, add);
    if (!flag_of(bus, "connected") && text_of(bus, "state") != "bus_off")
      add(name + " is not connected (" + text_of(bus, "last_error") + ")",
          bus_remedy(text_of(bus, "kind")));
  }
}

}  // namespace

std::string_view bus_remedy(std::string_view kind) {
  if (kind == "modbus_tcp") return "check the module's power, cable, address and port";
  if (kind == "modbus_rtu") return "check that the adapter is plugged in and is the `device` named";
  return "check the interface (ip -details link show) and its cable";
}

bool has_reason(const json& status, const char* name) {
  const json& reasons = list_of(status, "reasons");
  return std::find(reasons.begin(), reasons.end(), json(name)) != reasons.end();
}

std::vector<std::string> axes_not_driven(const json& status) {
  std::vector<std::string> names;
  for (const json& axis : list_of(status, "axes")) {
    if (!flag_of(axis, "driven")) names.push_back(text_of(axis, "name"));
  }
  return names;
}

std::string joined(const std::vector<std::string>& words) {
  std::string result;
  for (const std::string& word : words) result += (result.empty() ? "" : ", ") + word;
  return result;
}

std::vector<std::string> estimate_lines(const json& answer) {
  std::vector<std::string> lines;
  std::vector<std::string> offsets;
  const json& inputs = list_of(answer, "inputs");
  const auto measured = std::count_if(inputs.begin(), inputs.end(),
                                      [](const json& input) { return flag_of(input, "good"); });
  for (const json& input : inputs) {
    if (!flag_of(input, "estimated")) continue;
    lines.push_back("block " + text_of(input, "block") + " is estimated from " +
                    std::to_string(measured) + (measured == 1 ? " other" : " others") + ", +-" +
                    fixed(number_of(input, "sd_K"), 2) + " K (1 sd)");
  }
  if (lines.empty()) return lines;
  for (const json& axis : list_of(answer, "axes")) {
    const double sd = number_of(axis, "offset_sd");
    const double sd_max = number_of(axis, "offset_sd_max");
    offsets.push_back(text_of(axis, "name") + " +-" + fixed(sd, 2) + " " + text_of(axis, "unit") +
                      (sd > sd_max ? " (too uncertain: at most " + fixed(sd_max, 2) + ")" : ""));
  }
  lines.push_back("this makes the offsets uncertain by (1 sd): " + joined(offsets));
  return lines;
}

bool is_compensating(const json& status) {
  return text_of(status, "mode") == "compensating" && !flag_of(status, "dry_run") &&
         axes_not_driven(status).empty() && !has_reason(status, "controller_offline");
}

Verdict verdict(const json& status) {
  const std::string mode = text_of(status, "mode");
  const std::string since = ", for " + duration_text(number_of(status, "mode_since_s"));
  if (flag_of(status, "dry_run"))
    return {false, true, "no: DRY RUN",
            ", nothing is written to the controller (" +
                (mode == "dry_run" ? "all is read and computed" : mode_words(mode)) + since + ")"};
  if (is_compensating(status)) {
    // An earlier daemon tells of the mode alone.
    const char* key = status.contains("compensating_s") ? "compensating_s" : "mode_since_s";
    return {true, true, "yes", ", for " + duration_text(number_of(status, key))};
  }
  if (mode == "compensating") {
    const auto idle = axes_not_driven(status);
    return {false, false, "no",
            idle.empty() ? " (the controller takes no offsets)"
                         : " (axes not driven: " + joined(idle) + ")"};
  }
  return {false, mode == "disabled", "no", " (" + mode_words(mode) + since + ")"};
}

std::string suspicion_text(const json& suspected) {
  return "off by " + fixed_signed(number_of(suspected, "size_K"), 1) +
         " K against its neighbours since " + local_time(number_of(suspected, "since")) +
         (flag_of(suspected, "weighed_down") ? ", not used" : ", used all the same");
}

std::vector<Trouble> troubles(const json& status) {
  std::vector<Trouble> list;
  const auto add = [&list](const std::string& what, std::string_view remedy) {
    list.push_back({what, std::string(remedy)});
  };
  for (const json& reason : list_of(status, "reasons")) {
    const std::string name = reason.is_string() ? reason.get<std::string>() : reason.dump();
    // Signals come from the controller: where that is away, it is the cause.
    if (name == "signal_lost" && has_reason(status, "controller_offline")) continue;
    const ReasonText text = reason_text(name);
    const bool switched_off = name == "operator_disabled" && flag_of(status, "dry_run");
    std::string meaning(text.meaning);
    const std::string error = text_of(object_of(status, "controller"), "last_error");
    if (name == "not_written" && !error.empty()) meaning += ": " + error;
    add(meaning, switched_off ? dry_run_remedy : text.remedy);
  }
  for (const std::string& estimate : estimate_lines(status)) add(estimate, "");
  std::vector<std::string> bad;
  for (const json& sensor : list_of(status, "sensors_bad"))
    if (sensor.is_string()) bad.push_back(sensor.get<std::string>());
  if (!bad.empty()) add("bad sensors: " + joined(bad), "thermocomp sensors says why");
  for (const json& sensor : list_of(status, "sensors_suspected"))
    add("sensor " + text_of(sensor, "name") + " is " + suspicion_text(sensor), "");
  add_bus_troubles(status, add);
  const json& controller = object_of(status, "controller");
  add_can_trouble("controller " + text_of(controller, "name"), controller, add);
  for (const json& warning : list_of(status, "warnings"))
    if (warning.is_string()) add(warning.get<std::string>(), "");
  return list;
}

}  // namespace thermocomp::cli
