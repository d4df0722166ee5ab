// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/hal_file.hpp"

#include <cmath>
#include <cstdio>
#include <set>

namespace thermocomp_linuxcnc {
namespace {

std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

void require(bool holds, const std::string& why) {
  if (!holds) throw BadOption(why);
}

void check(const HalFileOptions& options) {
  require(!options.axes.empty(), "at least one axis must be given, as in --axes x=0,z=2");
  std::set<char> letters;
  std::set<int> joints;
  for (const HalAxis& axis : options.axes) {
    const std::string letter(1, axis.letter);
    require(std::string("xyzuvw").find(axis.letter) != std::string::npos,
            "axis " + letter + ": only x y z u v w are linear");
    require(axis.joint >= 0 && axis.joint < 16, "axis " + letter + ": joints are 0 to 15");
    require(letters.insert(axis.letter).second, "axis " + letter + " is given twice");
    require(joints.insert(axis.joint).second,
            "joint " + std::to_string(axis.joint) + " is given twice");
  }
  const auto positive = [](double value, double most, const char* what) {
    // Negated, so that NaN is refused too.
    if (!(value > 0.0 && value <= most))
      throw BadOption(std::string(what) + " must be more than 0 and at most " + number_text(most));
  };
  positive(options.offset_mm_max, 1.0, "the largest offset in mm");
  positive(options.speed_mm_per_s, 10.0, "the speed in mm/s");
  positive(options.homing_speed_mm_per_s, 10.0, "the homing speed in mm/s");
  positive(options.acceleration_mm_per_s2, 1000.0, "the acceleration in mm/s2");
  positive(options.homing_acceleration_mm_per_s2, 1000.0, "the homing acceleration in mm/s2");
}

class Writer {
 public:
  explicit Writer(const HalFileOptions& options)
      : options_(options), unit_mm_(unit_mm(options.unit)) {}

  void line(const std::string& text) { text_.append(text).append("\n"); }
  void set(const std::string& pin, const std::string& value) { line("setp " + pin + " " + value); }
  /// Sets a length, speed or acceleration, which HAL has in the machine's unit.
  void set_mm(const std::string& pin, double mm) { set(pin, number_text(mm / unit_mm_)); }

  /// Loads an instance per name and axis: limit3 names=tc.limit-x,tc.limit-y
  void load(const std::string& kind, const std::string& each, const std::string& further = {}) {
    std::string names = further;
    for (const HalAxis& axis : options_.axes) {
      if (each.empty()) break;
      names.append(names.empty() ? "" : ",").append("tc.").append(each).append("-");
      names.push_back(axis.letter);
    }
    line("loadrt " + kind + " names=" + names);
  }

  /// Connects a pin of LinuxCNC to our pins, by the machine's own signal if it has one.
  void from_machine(const std::string& pin, const std::string& signal, const std::string& ours) {
    const std::string own = signal_of(pin, "");
    line("net " + (own.empty() ? signal + " " + pin : own) + " => " + ours);
  }
  void net(const std::string& signal, const std::string& from, const std::string& to) {
    line("net " + signal + " " + from + " => " + to);
  }
  /// Adds a function to the thread at a position from the front (> 0) or the end (< 0).
  void run(const std::string& function, int position) {
    line("addf " + function + " " + options_.thread + " " + std::to_string(position));
  }
  /// Calls f(letter, joint pin, axis pin) for each axis.
  template <class Each>
  void each(Each what) {
    for (const HalAxis& axis : options_.axes)
      what(std::string(1, axis.letter), "joint." + std::to_string(axis.joint),
           std::string("axis.").append(1, axis.letter));
  }
  [[nodiscard]] std::string text() const { return text_; }
  /// @throws BadOption: --signal names a pin that the file does not connect
  void require_known_pins() const {
    for (const auto& [pin, signal] : options_.signals)
      if (known_pins_.count(pin) == 0)
        throw BadOption("--signal " + pin + "=" + signal + ": the file does not connect the pin " +
                        pin + "; it connects" + list(known_pins_));
  }
  [[nodiscard]] const HalFileOptions& options() const { return options_; }
  /// Signal of a pin in the machine's own files, or `usual`.
  [[nodiscard]] std::string signal_of(const std::string& pin, const std::string& usual) {
    known_pins_.insert(pin);
    const auto own = options_.signals.find(pin);
    return own == options_.signals.end() ? usual : own->second;
  }
  /// Signal that is true while offsets are taken. Joint: all joints are homed.
  [[nodiscard]] std::string taking() {
    return options_.way == Way::external ? "tc-taking"
                                         : signal_of("motion.is-all-homed", "tc-homed");
  }
  [[nodiscard]] std::string bridge(const std::string& pin) const {
    return options_.name + "." + pin;
  }

 private:
  static std::string list(const std::set<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += " " + name;
    return text;
  }

  const HalFileOptions& options_;
  const double unit_mm_;
  std::string text_;
  std::set<std::string> known_pins_;
};

/// @param is_running  LinuxCNC runs already, and its ini file is out of reach
void load_bridge(Writer& out, const std::string& name, bool is_running) {
  const HalFileOptions& options = out.options();
  std::string letters;
  for (const HalAxis& axis : options.axes) letters.push_back(axis.letter);
  out.line("loadusr -Wn " + name + " " + options.command + " --name " + name + " --axes " +
           letters + " --units " + (is_running ? options.unit : "[TRAJ]LINEAR_UNITS") +
           " --made-for " + options.unit +
           (options.arguments.empty() ? "" : " " + options.arguments));
}

/// Connects inputs before outputs, so that a bridge that joins knows the applied offsets first.
void connect_bridge(Writer& out, const std::string& name) {
  const auto pin = [&](const std::string& end) { return name + "." + end; };
  out.each([&](const std::string& axis, const std::string&, const std::string& axis_pin) {
    out.line("net tc-applied-" + axis + " => " + pin("applied-" + axis));
    out.line("net tc-wanted-" + axis + " => " + pin("wanted-" + axis));
    out.from_machine(axis_pin + ".pos-cmd", "tc-position-" + axis, pin("position-" + axis));
  });
  out.from_machine("motion.motion-type", "tc-motion-type", pin("motion-type"));
  out.from_machine("motion.motion-enabled", "tc-enabled", pin("enabled"));
  out.from_machine("motion.is-all-homed", "tc-homed", pin("homed"));
  out.from_machine("spindle.0.speed-out", "tc-spindle", pin("spindle-rpm"));
  out.from_machine("iocontrol.0.coolant-flood", "tc-flood", pin("flood"));
  out.from_machine("iocontrol.0.coolant-mist", "tc-mist", pin("mist"));
  if (out.options().program_running)
    out.from_machine("halui.program.is-running", "tc-running", pin("program-running"));
  out.line("net " + out.taking() + " => " + pin("taking"));
  out.line("net tc-heartbeat <= " + pin("heartbeat"));
  out.line("net tc-bridge-fresh <= " + pin("fresh"));
  out.line("net tc-bridge-warning <= " + pin("warning"));
  out.each([&](const std::string& axis, const std::string&, const std::string&) {
    out.line("net tc-asked-" + axis + " <= " + pin("offset-" + axis));
  });
}

/// Detects a stopped bridge or daemon by a constant heartbeat. It only warns; the offsets hold.
void write_warning(Writer& out) {
  out.line("\n# ---- fresh and warning: signals tc-fresh, tc-warning and an operator message");
  out.set("tc.alive.rising", "1");
  out.set("tc.alive.falling", "1");
  out.set("tc.alive.width", "1.5");
  out.line("net tc-heartbeat => tc.alive.in");
  out.net("tc-alive", "tc.alive.out", "tc.fresh.in0");
  out.line("net tc-bridge-fresh => tc.fresh.in1");
  out.net("tc-fresh", "tc.fresh.out", "tc.stale.in");
  out.net("tc-stale", "tc.stale.out", "tc.warn.in0");
  out.line("net tc-bridge-warning => tc.warn.in1");
  out.net("tc-warning", "tc.warn.out", "tc.tell.in0");
  // Only an enabled machine without offsets needs a message.
  out.from_machine("motion.motion-enabled", "tc-enabled", "tc.tell.in1");
  out.net("tc-tell", "tc.tell.out", "tc.message.trigger");
}

void write_limits(Writer& out, const std::string& axis) {
  const HalFileOptions& options = out.options();
  const std::string limit = "tc.limit-" + axis;
  out.set_mm(limit + ".min", -options.offset_mm_max);
  out.set_mm(limit + ".max", options.offset_mm_max);
  out.line("net tc-asked-" + axis + " => tc.gate-" + axis + ".in1");
  out.set("tc.gate-" + axis + ".in0", "0");
  out.line("net " + out.taking() + " => tc.gate-" + axis + ".sel");
  out.net("tc-gated-" + axis, "tc.gate-" + axis + ".out", limit + ".in");
}

const char* const warning_parts[] = {"tc.alive", "tc.fresh", "tc.stale",
                                     "tc.warn",  "tc.tell",  "tc.message"};
constexpr const char* message_text =
    "messages=\"thermocomp: the thermal offsets are not fresh or not applied - they are held\"";

void write_joint(Writer& out) {
  const HalFileOptions& options = out.options();
  out.load("mux2", "gate", "tc.speed,tc.acceleration");
  out.load("limit3", "limit");
  out.load("offset", "offset");
  out.load("sum2", "back");
  out.load("oneshot", "", "tc.alive");
  out.load("and2", "", "tc.fresh,tc.tell");
  out.load("not", "", "tc.stale");
  out.load("or2", "", "tc.warn");
  out.line(std::string("loadrt message names=tc.message ") + message_text);
  out.line("");
  out.each([&](const std::string& axis, const std::string&, const std::string&) {
    out.run("tc.offset-" + axis + ".update-feedback", options.feedback_position);
  });
  const auto at_end = [&](const std::string& function) {
    out.run(function, options.output_position);
  };
  at_end("tc.speed");
  at_end("tc.acceleration");
  out.each([&](const std::string& axis, const std::string&, const std::string&) {
    for (const char* part : {"tc.gate-", "tc.limit-"}) at_end(part + axis);
    at_end("tc.offset-" + axis + ".update-output");
    at_end("tc.back-" + axis);
  });
  for (const char* part : warning_parts) at_end(part);

  out.line(
      "\n# ---- offsets apply while all joints are homed, else they return to zero, so that none\n"
      "# ---- is in effect during homing");
  out.from_machine("motion.is-all-homed", "tc-homed", "tc.speed.sel tc.acceleration.sel");
  out.set_mm("tc.speed.in0", options.homing_speed_mm_per_s);
  out.set_mm("tc.speed.in1", options.speed_mm_per_s);
  out.set_mm("tc.acceleration.in0", options.homing_acceleration_mm_per_s2);
  out.set_mm("tc.acceleration.in1", options.acceleration_mm_per_s2);
  out.line("net tc-speed tc.speed.out");
  out.line("net tc-acceleration tc.acceleration.out");
  out.each([&](const std::string& axis, const std::string& joint, const std::string&) {
    const std::string limit = "tc.limit-" + axis;
    const std::string offset = "tc.offset-" + axis;
    out.line("\n# ---- axis " + axis);
    write_limits(out, axis);
    out.line("net tc-speed => " + limit + ".maxv");
    out.line("net tc-acceleration => " + limit + ".maxa");
    out.net("tc-wanted-" + axis, limit + ".out", offset + ".offset");
    out.net("tc-motion-cmd-" + axis, joint + ".motor-pos-cmd",
            offset + ".in tc.back-" + axis + ".in1");
    out.net(out.signal_of(offset + ".out", "tc-motor-cmd-" + axis), offset + ".out",
            "tc.back-" + axis + ".in0");
    out.set("tc.back-" + axis + ".gain1", "-1");
    out.line("net tc-applied-" + axis + " tc.back-" + axis + ".out");
    out.line("net " + out.signal_of(offset + ".fb-in", "tc-motor-fb-" + axis) + " => " + offset +
             ".fb-in");
    out.net("tc-motion-fb-" + axis, offset + ".fb-out", joint + ".motor-pos-fb");
  });
}

/// One count of eoffset-counts [mm or inch]; finer than any offset.
constexpr double count = 1e-6;

void write_external(Writer& out) {
  const HalFileOptions& options = out.options();
  out.load("and2", "", "tc.on,tc.fresh,tc.tell");
  out.load("not", "", "tc.clear,tc.stale");
  out.load("mux2", "gate");
  out.load("limit3", "limit");
  out.load("scale", "scale");
  out.load("conv_float_s32", "count");
  out.load("oneshot", "", "tc.alive");
  out.load("or2", "", "tc.warn");
  out.line(std::string("loadrt message names=tc.message ") + message_text);
  out.line("");
  int place = 1;
  const auto next = [&](const std::string& function) { out.run(function, place++); };
  next("tc.on");
  next("tc.clear");
  out.each([&](const std::string& axis, const std::string&, const std::string&) {
    for (const char* part : {"tc.gate-", "tc.limit-", "tc.scale-", "tc.count-"}) next(part + axis);
  });
  for (const char* part : warning_parts) next(part);

  out.line(
      "\n# ---- the gate: counts are incremental, so they begin at zero whenever LinuxCNC does");
  out.from_machine("motion.motion-enabled", "tc-enabled", "tc.on.in0");
  out.from_machine("motion.is-all-homed", "tc-homed", "tc.on.in1");
  out.net("tc-taking", "tc.on.out", "tc.clear.in");
  out.line("net tc-clear tc.clear.out");
  out.each([&](const std::string& axis, const std::string&, const std::string& axis_pin) {
    const std::string limit = "tc.limit-" + axis;
    out.line("\n# ---- axis " + axis);
    write_limits(out, axis);
    out.line("net tc-clear => " + limit + ".load " + axis_pin + ".eoffset-clear");
    out.set_mm(limit + ".maxv", options.speed_mm_per_s);
    out.set_mm(limit + ".maxa", options.acceleration_mm_per_s2);
    out.net("tc-limited-" + axis, limit + ".out", "tc.scale-" + axis + ".in");
    out.set("tc.scale-" + axis + ".gain", number_text(1.0 / count));
    out.net("tc-scaled-" + axis, "tc.scale-" + axis + ".out", "tc.count-" + axis + ".in");
    out.net("tc-counts-" + axis, "tc.count-" + axis + ".out", axis_pin + ".eoffset-counts");
    out.set(axis_pin + ".eoffset-scale", number_text(count));
    out.set(axis_pin + ".eoffset-enable", "1");
    out.line("net tc-wanted-" + axis + " " + axis_pin + ".eoffset-request");
    out.line("net tc-applied-" + axis + " " + axis_pin + ".eoffset");
  });
}

}  // namespace

double unit_mm(const std::string& name) {
  for (const char* mm : {"mm", "metric"})
    if (name == mm) return 1.0;
  for (const char* inch : {"in", "inch", "imperial"})
    if (name == inch) return 25.4;
  throw BadOption("unit " + name + ": LINEAR_UNITS are mm or inch");
}

std::string hal_file(const HalFileOptions& options) {
  check(options);
  Writer out(options);
  out.line(
      "# Thermal offsets, made by `thermocomp-linuxcnc hal`: make it again rather than edit it.");
  out.line("# To be loaded after the machine's own HAL files.");
  load_bridge(out, options.name, false);
  if (options.way == Way::joint)
    write_joint(out);
  else
    write_external(out);
  write_warning(out);
  out.line("\n# ---- the bridge");
  connect_bridge(out, options.name);
  out.require_known_pins();
  return out.text();
}

std::string rejoin_file(const HalFileOptions& options, const std::string& name) {
  check(options);
  if (name.empty()) throw BadOption("the component that takes over needs a name");
  Writer out(options);
  if (name != options.name) {
    // After a clean end a component's pins are gone; a killed one still holds its signals.
    for (const char* pin : {"heartbeat", "fresh", "warning"})
      out.line("unlinkp " + out.bridge(pin));
    out.each([&](const std::string& axis, const std::string&, const std::string&) {
      out.line("unlinkp " + out.bridge("offset-" + axis));
    });
  }
  load_bridge(out, name, true);
  connect_bridge(out, name);
  return out.text();
}

}  // namespace thermocomp_linuxcnc
