#include "cli/observe/status_text.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/common/terminal.hpp"
#include "cli/observe/events_text.hpp"
#include "cli/observe/troubles.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;

constexpr int key_width = 15;

std::string line(const std::string& key, const std::string& value) {
  return padded(key, key_width) + " : " + value + "\n";
}

std::string with_unit(double value, int digits, const std::string& unit) {
  return fixed_signed(value, digits, 8) + " " + unit;
}

std::string headline(const json& status, bool colours) {
  const Verdict told = verdict(status);
  const Colour colour = told.compensating ? Colour::green
                        : told.intended   ? Colour::yellow
                                          : Colour::red;
  return line("Compensating", coloured(told.answer, colour, colours) + told.detail);
}

std::string axis_marks(const json& axis) {
  std::vector<std::string> marks;
  if (!flag_of(axis, "driven")) marks.emplace_back("not driven");
  if (!flag_of(axis, "synced")) marks.emplace_back("read-back unknown");
  const json& mismatch = object_of(axis, "mismatch");
  if (!mismatch.empty())
    marks.emplace_back(flag_of(mismatch, "releasing") ? "mismatch, being released"
                                                      : "mismatch latched");
  else if (flag_of(axis, "disagrees"))
    marks.emplace_back("read-back disagrees");
  if (flag_of(axis, "at_bound")) marks.emplace_back("at its bound");
  if (flag_of(axis, "proving")) marks.emplace_back("proving its sign");
  return marks.empty() ? "" : "  [" + joined(marks) + "]";
}

/// "gains 1.08, 0.94; spread of the estimate 1.2 um; a probing is worth it"
std::string correction_text(const json& correction) {
  std::string text("gains");
  for (const json& gain : list_of(correction, "gains"))
    text.append(text == "gains" ? " " : ", ").append(fixed(number_of(gain, "gain"), 3));
  text.append("; spread of the estimate ").append(fixed(number_of(correction, "sd_um"), 1));
  text.append(" um");
  if (flag_of(correction, "probing_wanted")) text.append("; a probing is worth it");
  return text;
}

std::string axes_lines(const json& status) {
  std::string result;
  for (const json& axis : list_of(status, "axes")) {
    const std::string unit = text_of(axis, "unit").empty() ? "um" : text_of(axis, "unit");
    std::string values = "offset " + with_unit(number_of(axis, "offset"), 2, unit) + ", target " +
                         with_unit(number_of(axis, "target"), 2, unit) + ", applied " +
                         with_unit(number_of(axis, "applied"), 2, unit);
    if (std::isfinite(number_of(axis, "measured"))) {
      values += ", measured " + with_unit(number_of(axis, "measured"), 2, unit);
    }
    result += line("Axis " + text_of(axis, "name"), values + axis_marks(axis));
    if (const json& mismatch = object_of(axis, "mismatch"); !mismatch.empty())
      result += line("", "sent " + with_unit(number_of(mismatch, "sent_um"), 2, unit) +
                             ", read back " + with_unit(number_of(mismatch, "read_um"), 2, unit) +
                             ": " + text_of(mismatch, "likely"));
    if (axis.contains("correction")) result += line("", correction_text(axis["correction"]));
  }
  return result;
}

std::string inputs_lines(const json& status) {
  std::string result;
  int width = key_width;  // the names one below the other, however long they are
  for (const json& input : list_of(status, "inputs"))
    width = std::max(width, std::min(40, static_cast<int>(text_of(input, "name").size())));
  for (const json& input : list_of(status, "inputs")) {
    const double temp_degC = number_of(input, "temp_degC");
    const double reference_degC = number_of(input, "reference_degC");
    const std::string lost = flag_of(input, "estimated")
                                 ? "  [estimated, +-" + fixed(number_of(input, "sd_K"), 2) + " K]"
                                 : "  [lost]";
    result += line(padded(text_of(input, "name"), width),
                   fixed(temp_degC, 2, 8) + " degC, reference " + fixed(reference_degC, 2, 8) +
                       " degC, rise " + fixed_signed(temp_degC - reference_degC, 2, 7) + " K" +
                       (flag_of(input, "good") ? "" : lost));
  }
  return result;
}

// Everything that is wrong, worst first: each line says what it is and what to do.
std::string trouble_lines(const json& status, bool colours) {
  std::string result;
  for (const Trouble& trouble : troubles(status))
    result += line(result.empty() ? "Problems" : "",
                   coloured(trouble.what, Colour::yellow, colours) +
                       (trouble.remedy.empty() ? "" : " -> " + trouble.remedy));
  return result.empty() ? line("Problems", "none") : result;
}

/// Outages of the last minutes that are over.
std::string ended_lines(const json& status) {
  std::string result;
  for (const json& event : list_of(status, "ended"))
    result += line(result.empty() ? "Lately" : "", event_text(event));
  return result;
}

/// Dry run: "; applies by itself z +3.00 um".
std::string shown_text(const json& controller) {
  std::string shown;
  for (const auto& [axis, value] : object_of(controller, "shown").items())
    if (value.is_number())
      shown += (shown.empty() ? "; applies by itself " : ", ") + axis + " " +
               fixed_signed(value.get<double>(), 2) + " um";
  return shown;
}

std::string controller_line(const json& status) {
  const json& controller = object_of(status, "controller");
  std::string state = flag_of(controller, "online") ? "online" : "offline";
  if (!flag_of(controller, "online") && !text_of(controller, "last_error").empty()) {
    state += " (" + text_of(controller, "last_error") + ")";
  }
  return line("Controller", text_of(controller, "name") + " (" + text_of(controller, "kind") +
                                "): " + state + shown_text(controller));
}

std::string signals_line(const json& status) {
  std::string values;
  for (const auto& [name, value] : object_of(object_of(status, "controller"), "signals").items()) {
    const double number = value.is_number() ? value.get<double>() : std::nan("");
    values += (values.empty() ? "" : ", ") + name + " " + fixed(number, 3);
  }
  return values.empty() ? "" : line("Signals", values);
}

std::string buses_line(const json& status) {
  std::string buses;
  for (const json& bus : list_of(status, "buses")) {
    const json& units = list_of(bus, "units");
    const auto answering = std::count_if(
        units.begin(), units.end(), [](const json& unit) { return flag_of(unit, "answering"); });
    buses += (buses.empty() ? "" : ", ") + text_of(bus, "name") + " (" + text_of(bus, "kind") +
             "): " + std::to_string(answering) + " of " + std::to_string(units.size()) +
             " units answer";
  }
  return buses.empty() ? "" : line("Buses", buses);
}

/// "; probings here differ by z 1.2 um rms"
std::string probed_text(const json& model) {
  std::string text;
  for (const auto& [axis, rms] : object_of(model, "probed_rms_um").items())
    if (rms.is_number())
      text += (text.empty() ? "; probings here differ by " : ", ") + axis + " " +
              fixed(rms.get<double>(), 1) + " um rms";
  return text;
}

/// Whether probings on this machine bear out what the model says of itself, an axis a line. RMS
/// over few probings differs from a true sd by a factor of two at most (one probing in twenty).
std::string model_error_lines(const json& model) {
  constexpr double worse = 2.0;
  std::string text;
  const json& claimed = object_of(model, "claimed_sd_um");
  for (const auto& [axis, rms] : object_of(model, "probed_rms_um").items()) {
    const double sd_um = number_of(claimed, axis.c_str());
    if (!rms.is_number() || !(sd_um > 0)) continue;
    const double rms_um = rms.get<double>();
    text += line(text.empty() ? "Model error" : "",
                 axis + ": probings differ by " + fixed(rms_um, 1) + " um rms, claimed is " +
                     fixed(sd_um, 1) + " um (1 sd): " +
                     (rms_um <= worse * sd_um
                          ? "as good as claimed"
                          : "WORSE than claimed -> thermocomp diagnose, or make the model anew"));
  }
  return text;
}

/// Who took the reference, when, and at what temperatures; each is with its input.
std::string reference_line(const json& status) {
  const json& reference = object_of(status, "reference");
  if (reference.empty()) return {};  // an earlier daemon does not say
  double low = std::nan("");
  double high = std::nan("");
  for (const auto& [name, temp_degC] : object_of(reference, "temps_degC").items()) {
    if (!temp_degC.is_number()) continue;
    low = std::fmin(low, temp_degC.get<double>());
    high = std::fmax(high, temp_degC.get<double>());
  }
  if (!std::isfinite(low)) return line("Reference", "none yet");
  const std::string by = text_of(reference, "by");
  const std::string when = local_time(number_of(reference, "wall_s"));
  std::string text = "it is not known when it was taken";
  if (by == "model_file") text = "the temperatures of the model file";
  if (by == "operator") text = "taken " + when + " by thermocomp reference";
  if (by == "first_values") text = "taken " + when + " from the first values of a start";
  if (by == "reload") text = "changed " + when + " with a reload";
  text += ", at " + fixed(low, 2) + (high > low ? " to " + fixed(high, 2) : "") + " degC";
  return line("Reference", (flag_of(reference, "lost") ? "LOST; in its place " : "") + text);
}

std::string model_line(const json& status) {
  const json& model = object_of(status, "model");
  std::string file = line("Model", text_of(model, "file") + " (SHA-256 " +
                                       text_of(model, "checksum").substr(0, 16) + ")");
  // An earlier daemon does not say.
  if (model.contains("compared") && !flag_of(model, "compared"))
    file += line("", "NEVER COMPARED with measured displacement, as far as its file says" +
                         probed_text(model));
  file += model_error_lines(model);
  if (!flag_of(model, "outside")) return file;
  return file + line("Domain", "outside of what the model was made from, " +
                                   fixed(100.0 * number_of(model, "outside_share_24h"), 0) +
                                   " % of the last 24 h");
}

std::string cycle_line(const json& status) {
  const json& cycle = object_of(status, "cycle");
  return line("Cycle", fixed(number_of(cycle, "rate_hz"), 0) + " Hz, " +
                           std::to_string(count_of(cycle, "count")) + " cycles, " +
                           std::to_string(count_of(cycle, "missed")) + " missed, lateness p50 " +
                           fixed(number_of(cycle, "lateness_us_p50"), 0) + " p99.9 " +
                           fixed(number_of(cycle, "lateness_us_p999"), 0) + " max " +
                           fixed(number_of(cycle, "lateness_us_max"), 0) + " us, work p50 " +
                           fixed(number_of(cycle, "work_us_p50"), 1) + " max " +
                           fixed(number_of(cycle, "work_us_max"), 1) + " us" +
                           (flag_of(cycle, "real_time") ? "" : "  [not real-time]"));
}

std::string history_line(const json& status) {
  const json& history = object_of(status, "history");
  if (!flag_of(history, "enabled")) return line("History", "off");
  std::string text = text_of(history, "file") + ", " + fixed(number_of(history, "size_MB"), 1) +
                     " MB, last commit " + duration_text(number_of(history, "last_commit_age_s")) +
                     " ago";
  const std::uint64_t lost = count_of(history, "lost_records");
  const std::uint64_t errors = count_of(history, "errors");
  if (lost > 0) text += ", " + std::to_string(lost) + " records lost";
  if (errors > 0) text += ", " + std::to_string(errors) + " errors";
  return line("History", text);
}

}  // namespace

namespace {

/// What is wrong while the machine is compensated all the same.
void add_degradations(const json& status, std::vector<std::string>& why) {
  for (const json& axis : list_of(status, "axes")) {
    const std::string name = "axis " + text_of(axis, "name");
    if (flag_of(axis, "at_bound")) why.push_back(name + " is at its bound");
    if (flag_of(axis, "disagrees")) why.push_back(name + ": the read-back disagrees");
  }
  for (const json& sensor : list_of(status, "sensors_bad"))
    if (sensor.is_string()) why.push_back("sensor " + sensor.get<std::string>() + " is bad");
  for (const json& bus : list_of(status, "buses")) {
    const std::string name = "bus " + text_of(bus, "name");
    if (!flag_of(bus, "connected")) why.push_back(name + " is not connected");
    for (const json& unit : list_of(bus, "units"))
      if (!flag_of(unit, "answering"))
        why.push_back(name + ": " + text_of(unit, "name") + " is silent");
  }
  const json& history = object_of(status, "history");
  if (flag_of(history, "enabled") && !flag_of(history, "working"))
    why.emplace_back("the history is not written");
}

}  // namespace

std::vector<std::string> why_not(const json& status, bool strict) {
  std::vector<std::string> why;
  if (!is_compensating(status)) {
    if (flag_of(status, "dry_run")) why.emplace_back("dry run: nothing is written");
    if (const std::string mode = text_of(status, "mode"); mode != "compensating")
      why.push_back("mode " + mode);
    for (const std::string& axis : axes_not_driven(status))
      why.push_back("axis " + axis + " is not driven");
  }
  if (!is_compensating(status) || strict)
    for (const json& reason : list_of(status, "reasons"))
      if (reason.is_string() && reason != "cutting") why.push_back(reason.get<std::string>());
  if (strict) add_degradations(status, why);
  return why;
}

std::string status_text(const json& status, bool colours) {
  return headline(status, colours) + trouble_lines(status, colours) + ended_lines(status) +
         axes_lines(status) + inputs_lines(status) + reference_line(status) +
         controller_line(status) + signals_line(status) + buses_line(status) + model_line(status) +
         cycle_line(status) + history_line(status) +
         line("Daemon", "version " + text_of(status, "version") + ", up " +
                            duration_text(number_of(status, "uptime_s")));
}

std::string sensors_text(const json& sensors, bool colours) {
  const json& list = list_of(sensors, "sensors");
  int width = 6;
  for (const json& sensor : list) {
    width = std::max(width, static_cast<int>(text_of(sensor, "name").size()));
  }
  std::string result =
      padded("sensor", width) + "  raw degC  smoothed  age s  clipped  in a row  rejected  state\n";
  for (const json& sensor : list) {
    const std::string fault = text_of(sensor, "fault");
    // Only a value that is no number comes without one.
    const bool is_nan = fault == "out_of_range" && std::isnan(number_of(sensor, "raw_degC"));
    const ReasonText text = is_nan ? nan_text() : fault_text(fault);
    const bool good = fault == "none";
    std::string state = coloured(text.meaning, good ? Colour::green : Colour::red, colours);
    if (const json& suspected = object_of(sensor, "suspected"); good && !suspected.empty())
      state = coloured("suspected: " + suspicion_text(suspected), Colour::yellow, colours);
    if (const json& jump = object_of(sensor, "jump"); !jump.empty())
      state += " (by " + fixed_signed(number_of(jump, "size_K"), 2) + " K)";
    if (!text.remedy.empty()) state += " -> " + std::string(text.remedy);
    result +=
        padded(text_of(sensor, "name"), width) + "  " + fixed(number_of(sensor, "raw_degC"), 2, 8) +
        "  " + fixed(number_of(sensor, "smoothed_degC"), 2, 8) + "  " +
        fixed(number_of(sensor, "age_s"), 1, 5) + "  " + fixed(number_of(sensor, "clipped"), 0, 7) +
        "  " + fixed(number_of(sensor, "clipped_in_a_row"), 0, 8) + "  " +
        fixed(number_of(sensor, "rejected"), 0, 8) + "  " + state + "\n";
  }
  for (const std::string& estimate : estimate_lines(sensors))
    result += coloured(estimate, Colour::yellow, colours) + "\n";
  return result;
}

}  // namespace thermocomp::cli
