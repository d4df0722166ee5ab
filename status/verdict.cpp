#include "status/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "status/figures.hpp"

namespace thermocomp {

namespace {

/// After a dry run the switch must not stay on, or the first offsets would be sent unattended.
constexpr std::string_view dry_run_remedy =
    "switched on, the offsets are shown; switch it off before the dry run ends";
constexpr std::string_view moves_nothing =
    "the model gives no displacement: all its coefficients are 0";
constexpr std::string_view can_remedy = "check cable, termination, bit rate";

bool is_network(std::string_view kind) {
  return kind.starts_with("modbus") && kind != "modbus_rtu";
}

std::vector<std::string> axes_not_driven(const Status& status) {
  std::vector<std::string> names;
  for (const AxisStatus& axis : status.axes)
    if (!axis.driven) names.push_back(axis.name);
  return names;
}

std::string confirmation_text(const Confirmation& values) {
  return "new values are being confirmed: " + joined(values.sensors) +
         " count after settle_s = " + duration_text(values.settle_s) +
         " without a jump or a pause of stale_after_s" +
         (values.one_value_of.empty()
              ? ""
              : ", and not while all channels of " + values.one_value_of +
                    " show one value, as a module that is not ready (if it is "
                    "right: thermocomp accept SENSOR)");
}

/// Collects faults, one entry per cause.
class Causes {
 public:
  Causes(const Status& status, const SensorsAnswer* sensors)
      : status_(status), sensors_(sensors), unexplained_(status.sensors_bad) {}

  std::vector<Trouble> all() {
    for (const BusStatus& bus : status_.buses) add_bus(bus);
    add_bad_sensors();
    std::vector<Trouble> sensors = std::exchange(list_, {});
    add_reasons(Severity::fault);
    std::move(sensors.begin(), sensors.end(), std::back_inserter(list_));
    for (const std::string& estimate : estimate_lines(status_.inputs, status_.axes)) add(estimate);
    add_doubtful_sensors();
    add_axes();
    add_can("controller " + status_.controller.name, status_.controller.state,
            status_.controller.state_s, {SubjectKind::controller, status_.controller.name});
    for (const Severity severity : {Severity::warning, Severity::intended, Severity::normal})
      add_reasons(severity);
    if (status_.mode == Mode::compensating && !status_.model.moves)
      add(std::string(moves_nothing), "fit one to measured runs", "thermocomp fit");
    if (!status_.reference.changed.empty())
      add("the reference was taken by itself while the machine was not even (" +
              status_.reference.changed + "): displacement is counted from there",
          "take another when the machine is cold and even", "thermocomp reference");
    for (const Confirmation& each : status_.confirming) add(confirmation_text(each));
    for (const FrozenModule& module : status_.modules_frozen)
      add("device " + module.name + ": " + frozen_text(module), frozen_remedy, "",
          {SubjectKind::device, module.name});
    for (const std::string& warning : status_.warnings) add(warning);
    return std::move(list_);
  }

 private:
  void add(const std::string& what, std::string_view remedy = "", std::string_view command = "",
           const Subject& subject = {}, const std::string& detail = "") {
    list_.push_back({what, std::string(remedy), std::string(command), subject, detail});
  }

  /// True if entries of sensors, modules or axes are more specific than the reason.
  [[nodiscard]] bool is_named_by_its_cause(Reason reason) const {
    const auto any_axis = [this](const auto& is_so) {
      return std::any_of(status_.axes.begin(), status_.axes.end(), is_so);
    };
    switch (reason) {
      case Reason::block_lost:
      case Reason::block_estimated:
        return !named_inputs_.empty() || only_settles() || !status_.confirming.empty();
      case Reason::signal_lost:  // signals and applied offsets come from the controller
      case Reason::not_synced:
        return has_reason(status_.reasons, Reason::controller_offline);
      case Reason::sensor_suspected:
        return !status_.sensors_suspected.empty();
      case Reason::sensor_unconfirmed:
        return !status_.sensors_jumped.empty();
      case Reason::at_bound:
        return any_axis([](const AxisStatus& axis) { return axis.at_bound; });
      case Reason::mismatch:
        return any_axis([](const AxisStatus& axis) { return axis.disagrees; });
      case Reason::mismatch_latched:
        return any_axis([](const AxisStatus& axis) { return axis.latched.has_value(); });
      default:
        return false;
    }
  }

  /// True if values are missing only because none has settled since the start.
  [[nodiscard]] bool only_settles() const {
    return status_.mode == Mode::starting && status_.sensors_bad.empty();
  }

  void add_reasons(Severity severity) {
    for (const Reason reason : members_of(status_.reasons)) {
      const CodeText text = code_text(reason);
      if (text.severity != severity || is_named_by_its_cause(reason)) continue;
      const std::string& error = status_.controller.last_error;
      const bool is_of_link = reason == Reason::not_written || reason == Reason::controller_offline;
      const bool switched_off = reason == Reason::operator_disabled && status_.dry_run;
      add(std::string(text.meaning), switched_off ? dry_run_remedy : text.remedy, text.command,
          is_of_link ? Subject(SubjectKind::controller, status_.controller.name) : Subject(),
          is_of_link ? error : "");
    }
  }

  /// The error in brackets; empty in the first second, before any error.
  static std::string in_brackets(const std::string& error) {
    return error.empty() ? "" : " (" + error + ")";
  }

  /// ": 4 sensors, inputs bed, table": the losses explained by these sensors.
  std::string lost_with(const std::vector<std::string>& sensors,
                        const std::vector<std::string>& blocks) {
    if (sensors.empty()) return {};
    for (const std::string& sensor : sensors) std::erase(unexplained_, sensor);
    return ": " + std::to_string(sensors.size()) + (sensors.size() == 1 ? " sensor" : " sensors") +
           input_text(lost_inputs(blocks));
  }

  /// Lost inputs of the blocks; each input is listed by one cause only.
  std::vector<std::string> lost_inputs(const std::vector<std::string>& blocks) {
    std::vector<std::string> lost;
    for (const InputStatus& input : status_.inputs)
      if (!input.good && std::find(blocks.begin(), blocks.end(), input.block) != blocks.end() &&
          named_inputs_.insert(input.block).second)
        lost.push_back(input.block);
    return lost;
  }

  static std::string input_text(const std::vector<std::string>& inputs) {
    return (inputs.empty() ? "" : inputs.size() == 1 ? ", input " : ", inputs ") + joined(inputs);
  }

  void add_bus(const BusStatus& bus) {
    const Subject subject{SubjectKind::bus, bus.name};
    add_can("bus " + bus.name, bus.state, bus.state_s, subject);
    if (!bus.connected && bus.state != "bus_off") {
      std::vector<std::string> sensors;
      std::vector<std::string> blocks;
      for (const UnitStatus& unit : bus.units) {
        sensors.insert(sensors.end(), unit.sensors.begin(), unit.sensors.end());
        blocks.insert(blocks.end(), unit.blocks.begin(), unit.blocks.end());
      }
      add("bus " + bus.name + " is not connected" + in_brackets(bus.last_error) +
              lost_with(sensors, blocks),
          bus_remedy(bus.kind), bus.kind == "can" ? "ip -details link show" : "", subject);
    }
    for (const UnitStatus& unit : bus.units)
      if (unit.answering && !unit.last_error.empty() && !status_.sensors_bad.empty())
        add("bus " + bus.name + ": " + unit.name + ": " + unit.last_error,
            "see the received bytes and suggested settings", "thermocomp scan", subject);
      else if (!unit.answering && bus.connected && !is_good_still(unit))
        add_silent(unit, is_network(bus.kind), subject);
  }

  /// True if all its readings are still valid: newly silent, or its first answer is not yet
  /// confirmed.
  [[nodiscard]] bool is_good_still(const UnitStatus& unit) const {
    const auto is_good = [this](const std::string& sensor) {
      const std::vector<std::string>& bad = status_.sensors_bad;
      return std::find(bad.begin(), bad.end(), sensor) == bad.end();
    };
    return !unit.sensors.empty() && std::all_of(unit.sensors.begin(), unit.sensors.end(), is_good);
  }

  void add_silent(const UnitStatus& unit, bool is_on_network, const Subject& subject) {
    const bool is_silent = unit.timeouts >= unit.bad_frames;
    const bool has_answered = unit.silent_s >= 0.0;
    add(unit.name +
            (!is_silent     ? " answers wrongly" + in_brackets(unit.last_error)
             : has_answered ? " silent for " + duration_text(unit.silent_s)
                            : " does not answer" + in_brackets(unit.last_error)) +
            lost_with(unit.sensors, unit.blocks),
        is_on_network && !is_silent
            ? "see the received bytes and suggested settings"
            : code_text(is_silent ? Fault::no_answer : Fault::bad_frame).remedy,
        "thermocomp scan", subject);
  }

  /// @param state_s  time of the CAN interface in `state`
  void add_can(const std::string& name, const std::optional<std::string>& state,
               std::optional<double> state_s, const Subject& subject) {
    const std::string lasts = " for " + duration_text(state_s.value_or(not_a_number));
    if (state == "bus_off")
      add(name + ": bus-off" + lasts, "check cable, termination, bit rate; then restart it",
          "ip link set IF type can restart, or let restart-ms do it", subject);
    if (state == "passive" || state == "warning")
      add(name + ": error " + *state + lasts, can_remedy, "", subject);
  }

  /// Adds bad sensors that are not explained by a silent module.
  void add_bad_sensors() {
    if (sensors_ == nullptr) {
      std::vector<std::string> blocks;
      for (const InputStatus& input : status_.inputs) blocks.push_back(input.block);
      if (!unexplained_.empty())
        add("bad sensors: " + joined(unexplained_) + input_text(lost_inputs(blocks)),
            "repair the sensor or its bus", "thermocomp sensors");
      return;
    }
    for (const SensorStatus& sensor : sensors_->sensors) {
      if (std::erase(unexplained_, sensor.name) == 0 || sensor.fault == Fault::none) continue;
      const CodeText fault = code_text(sensor.fault);
      add("sensor " + sensor.name +
              (sensor.jump ? jump_text(*sensor.jump) : ": " + std::string(fault.meaning)) +
              input_text(lost_inputs(sensor.blocks)),
          fault.remedy, fault.command, {SubjectKind::sensor, sensor.name});
    }
  }

  static std::string jump_text(const Jump& jump) {
    return " jumped by " + fixed_signed(jump.size_K, 1) + " K";
  }

  void add_doubtful_sensors() {
    const CodeText unconfirmed = code_text(Reason::sensor_unconfirmed);
    if (sensors_ == nullptr)
      for (const JumpedSensor& sensor : status_.sensors_jumped)
        add("sensor " + sensor.name + jump_text(sensor.jump), unconfirmed.remedy,
            "thermocomp accept " + sensor.name);
    for (const SuspectedSensor& sensor : status_.sensors_suspected)
      add("sensor " + sensor.name + " is " + suspicion_text(sensor.suspicion),
          code_text(Reason::sensor_suspected).remedy, "", {SubjectKind::sensor, sensor.name});
  }

  void add_axes() {
    for (const AxisStatus& axis : status_.axes) {
      const std::string name = "axis " + axis.name;
      const Subject subject{SubjectKind::axis, axis.name};
      if (axis.latched)
        add(name + " is not driven: " + fixed(axis.latched->sent_um, 1) + " um was sent, " +
                fixed(axis.latched->read_um, 1) + " um was read back (" + axis.latched->likely +
                ")" +
                (std::isfinite(axis.applied) ? ", now " + fixed(axis.applied, 1) + " " + axis.unit
                                             : std::string()),
            "remove the cause, then release the axis", "thermocomp release " + axis.name, subject);
      else if (axis.disagrees)
        add(name + ": the controller " +
                (std::isfinite(axis.applied) ? "applies " + fixed(axis.applied, 1) + " " + axis.unit
                                             : "shows no number for what it applies") +
                ", " + fixed(axis.offset, 1) + " was sent",
            code_text(Reason::mismatch).remedy, "", subject);
      if (axis.unexplained)
        add(name + ": the last probing found a displacement of " +
                fixed(axis.unexplained->measured, 1) + " " + axis.unit +
                ", of which the model gave " + fixed(axis.unexplained->modelled, 1),
            "measure again; if it is right, fit the model to measured runs of this machine",
            "thermocomp fit", subject);
      if (axis.at_bound)
        add(name + " at its bound" + remaining_text(axis), code_text(Reason::at_bound).remedy, "",
            subject);
    }
  }

  /// ": 7.0 of 19.0 um remain"
  static std::string remaining_text(const AxisStatus& axis) {
    const double remains = std::abs(axis.target - axis.offset);
    if (!std::isfinite(remains)) return {};
    return ": " + fixed(remains, 1) + " of " + fixed(std::abs(axis.target), 1) + " " + axis.unit +
           " remain";
  }

  const Status& status_;
  const SensorsAnswer* sensors_;
  std::vector<std::string> unexplained_;  ///< bad sensors without an entry
  std::set<std::string> named_inputs_;    ///< lost inputs listed in an entry
  std::vector<Trouble> list_;
};

/// The axis farthest from its target: "z has 35.1 um still to go to -48.6 um". Empty if every axis
/// is nearer than a lost input may leave it. An axis at its bound is a trouble.
std::string distance_to_target_text(const std::vector<AxisStatus>& axes) {
  const AxisStatus* farthest = nullptr;
  const auto way = [](const AxisStatus& axis) { return std::abs(axis.target - axis.offset); };
  for (const AxisStatus& axis : axes)
    if (!axis.at_bound && way(axis) > axis.offset_sd_max &&
        (farthest == nullptr || way(axis) > way(*farthest)))
      farthest = &axis;
  if (farthest == nullptr) return {};
  return farthest->name + " has " + fixed(way(*farthest), 1) + " " + farthest->unit +
         " still to go to " + fixed_signed(farthest->target, 1) + " " + farthest->unit;
}

/// Adds degradations that do not stop the compensation.
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
  for (const FrozenModule& module : status.modules_frozen)
    why.push_back("device " + module.name + ": " + frozen_text(module));
  if (status.history.enabled && !status.history.working)
    why.emplace_back("the history is not written");
  if (!status.reference.changed.empty())
    why.emplace_back("the reference was taken while the machine was not even");
  why.insert(why.end(), status.warnings.begin(), status.warnings.end());
}

}  // namespace

bool is_compensating(const Status& status) {
  return status.mode == Mode::compensating && !status.dry_run && axes_not_driven(status).empty() &&
         !has_reason(status.reasons, Reason::controller_offline) && status.model.moves;
}

Verdict verdict(const Status& status) {
  const CodeText mode = code_text(status.mode, false);
  if (status.dry_run) {
    const bool computes = status.mode == Mode::compensating;
    return {false, true, "no: DRY RUN",
            "nothing is written to the controller; " +
                std::string(computes ? "all is read and computed" : mode.meaning),
            status.mode_since_s};
  }
  if (is_compensating(status))
    return {true, true, "yes", "", status.compensating_s, distance_to_target_text(status.axes)};
  const auto idle = axes_not_driven(status);
  if (status.mode == Mode::compensating)
    return {false, false, "no",
            !idle.empty()         ? "axes not driven: " + joined(idle)
            : !status.model.moves ? std::string(moves_nothing)
                                  : "the controller takes no offsets"};
  const bool has_idle = status.mode == Mode::disabled && !idle.empty();
  return {false,
          status.mode == Mode::disabled,
          "no",
          std::string(mode.meaning) + (has_idle ? "; not driven: " + joined(idle) : ""),
          status.mode_since_s,
          std::string(mode.remedy)};
}

std::string detail_of(const Verdict& verdict) {
  std::string text = verdict.meaning;
  if (text.empty() || std::isfinite(verdict.for_s))
    text += (text.empty() ? "for " : ", for ") + duration_text(verdict.for_s);
  return verdict.advice.empty() ? text : text + ": " + verdict.advice;
}

std::string verdict_text(const Verdict& verdict) {
  return verdict.answer == "no" ? "no (" + detail_of(verdict) + ")"
                                : verdict.answer + ", " + detail_of(verdict);
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
    if (!status.model.moves) why.emplace_back(moves_nothing);
  }
  for (const Reason reason : members_of(status.reasons)) {
    const Severity severity = code_text(reason).severity;
    const bool counts = !compensating || strict || severity == Severity::fault;
    if (counts && severity != Severity::normal) why.emplace_back(to_string(reason));
  }
  if (strict) add_degradations(status, why);
  return why;
}

std::vector<Trouble> troubles(const Status& status, const SensorsAnswer* sensors) {
  return Causes(status, sensors).all();
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

std::string frozen_text(const FrozenModule& module) {
  return "the same values for " + duration_text(module.same_s) + ", up and down before: frozen?";
}

bool settles(const SensorStatus& sensor) {
  return sensor.fault == Fault::unconfirmed && !sensor.jump;
}

CodeText fault_text(const SensorStatus& sensor) {
  CodeText text = code_text(sensor.fault);
  if (settles(sensor))
    text = {text.name, "new: counts once it has lasted settle_s", "", Severity::normal};
  return text;
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
  return "check the interface and its cable";
}

}  // namespace thermocomp
