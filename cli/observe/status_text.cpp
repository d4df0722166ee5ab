#include "cli/observe/status_text.hpp"

#include <algorithm>
#include <cmath>

#include "report/terminal.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace thermocomp::cli {

namespace {

constexpr int key_width = 15;

std::string line(const std::string& key, const std::string& value) {
  return padded(key, key_width) + " : " + value + "\n";
}

std::string with_unit(double value, int digits, const std::string& unit) {
  return fixed_signed(value, digits, 8) + " " + unit;
}

std::string headline(const Status& status, bool colours) {
  const Verdict now = verdict(status);
  const Colour colour = now.compensating ? Colour::green
                        : now.intended   ? Colour::yellow
                                         : Colour::red;
  const std::string text = verdict_text(now);
  return line("Compensating",
              coloured(now.answer, colour, colours) + text.substr(now.answer.size()));
}

std::string axis_marks(const AxisStatus& axis) {
  std::vector<std::string> marks;
  if (!axis.driven) marks.emplace_back("not driven");
  if (!axis.synced) marks.emplace_back("read-back unknown");
  if (axis.latched)
    marks.emplace_back(axis.latched->releasing ? "mismatch, being released" : "mismatch latched");
  else if (axis.disagrees)
    marks.emplace_back("read-back disagrees");
  if (axis.at_bound) marks.emplace_back("at its bound");
  if (axis.proving) marks.emplace_back("proving its sign");
  return marks.empty() ? "" : "  [" + joined(marks) + "]";
}

/// "gains 1.08, 0.94; spread of the estimate 1.2 um; a probing is worth it"
std::string correction_text(const CorrectionStatus& correction) {
  std::string text("gains");
  for (const GainStatus& gain : correction.gains)
    text.append(text == "gains" ? " " : ", ").append(fixed(gain.gain, 3));
  text.append("; spread of the estimate ").append(fixed(correction.sd_um, 1)).append(" um");
  if (correction.probing_wanted) text.append("; a probing is worth it");
  return text;
}

/// "a probing is due: the model may be off by 3.4 um; 12.0 um still to come, warm in 35 min"
std::string next_text(const Status& status, const AxisStatus& axis) {
  std::string text;
  const auto is_due = [&](const ProbeDueStatus& due) {
    const auto found = due.axes.find(axis.name);
    return found != due.axes.end() && found->second;
  };
  if (status.probe_due && is_due(*status.probe_due))
    text = "a probing is due: the model may be off by " + fixed(status.probe_due->because_um, 1) +
           " um since the last one";
  const auto warm = status.warm.find(axis.name);
  if (warm == status.warm.end() || !std::isfinite(warm->second.remaining_um)) return text;
  if (!text.empty()) text += "; ";
  text += fixed(warm->second.remaining_um, 1) + " " + axis.unit + " still to come at this load, ";
  return text + (warm->second.minutes > 0.0 ? "warm in " + duration_text(60 * warm->second.minutes)
                                            : std::string("warm enough"));
}

std::string axes_lines(const Status& status) {
  std::string result;
  for (const AxisStatus& axis : status.axes) {
    std::string values = "offset " + with_unit(axis.offset, 2, axis.unit) + ", target " +
                         with_unit(axis.target, 2, axis.unit) + ", applied " +
                         with_unit(axis.applied, 2, axis.unit);
    if (std::isfinite(axis.measured))
      values += ", measured " + with_unit(axis.measured, 2, axis.unit);
    result += line("Axis " + axis.name, values + axis_marks(axis));
    if (axis.latched)
      result += line("", "sent " + with_unit(axis.latched->sent_um, 2, axis.unit) + ", read back " +
                             with_unit(axis.latched->read_um, 2, axis.unit) + ": " +
                             axis.latched->likely);
    if (axis.correction) result += line("", correction_text(*axis.correction));
    const std::string next = next_text(status, axis);
    if (!next.empty()) result += line("", next);
  }
  return result;
}

std::string inputs_lines(const Status& status) {
  std::string result;
  int width = key_width;  // widened to align the names
  for (const InputStatus& input : status.inputs)
    width = std::max(width, std::min(40, static_cast<int>(input.name.size())));
  for (const InputStatus& input : status.inputs) {
    const std::string lost =
        input.estimated ? "  [estimated, +-" + fixed(input.sd_K, 2) + " K]" : "  [lost]";
    result += line(padded(input.name, width),
                   fixed(input.temp_degC, 2, 8) + " degC, reference " +
                       fixed(input.reference_degC, 2, 8) + " degC, rise " +
                       fixed_signed(input.temp_degC - input.reference_degC, 2, 7) + " K" +
                       (input.good ? "" : lost));
  }
  return result;
}

// All troubles, worst first, one line each with its remedy.
std::string trouble_lines(const Status& status, bool colours) {
  std::string result;
  for (const Trouble& trouble : troubles(status))
    result += line(
        result.empty() ? "Problems" : "",
        coloured(trouble.what + (trouble.detail.empty() ? "" : ": " + trouble.detail),
                 Colour::yellow, colours) +
            (trouble.remedy.empty() ? "" : " -> " + with_command(trouble.remedy, trouble.command)));
  return result.empty() ? line("Problems", "none") : result;
}

/// Outages that ended within the last minutes.
std::string ended_lines(const Status& status) {
  std::string result;
  for (const Event& event : status.ended)
    result += line(result.empty() ? "Lately" : "", event_text(event));
  return result;
}

/// For a dry run: "; applies by itself z +3.00 um".
std::string shown_text(const ControllerStatus& controller) {
  std::string shown;
  if (!controller.shown) return shown;
  for (const auto& [axis, value_um] : *controller.shown)
    if (std::isfinite(value_um))
      shown += (shown.empty() ? "; applies by itself " : ", ") + axis + " " +
               fixed_signed(value_um, 2) + " um";
  return shown;
}

std::string controller_lines(const ControllerStatus& controller) {
  std::string state = controller.online ? "online" : "offline";
  if (!controller.online && !controller.last_error.empty())
    state += " (" + controller.last_error + ")";
  std::string lines = line("Controller", controller.name + " (" + controller.kind + "): " + state +
                                             shown_text(controller));
  const std::string write = write_text(controller.write);
  return write.empty() ? lines : lines + line("", write);
}

std::string signals_line(const Status& status) {
  std::string values;
  for (const auto& [name, value] : status.controller.signals)
    values += (values.empty() ? "" : ", ") + name + " " + fixed(value, 3);
  return values.empty() ? "" : line("Signals", values);
}

std::string buses_line(const Status& status) {
  std::string buses;
  for (const BusStatus& bus : status.buses) {
    const auto answering = std::count_if(bus.units.begin(), bus.units.end(),
                                         [](const UnitStatus& unit) { return unit.answering; });
    buses += (buses.empty() ? "" : ", ") + bus.name + " (" + bus.kind +
             "): " + std::to_string(answering) + " of " + std::to_string(bus.units.size()) +
             " units answer";
  }
  return buses.empty() ? "" : line("Buses", buses);
}

/// "; probings here differ by z 1.2 um rms"
std::string probed_text(const ModelStatus& model) {
  std::string text;
  for (const auto& [axis, rms_um] : model.probed_rms_um)
    if (std::isfinite(rms_um))
      text += (text.empty() ? "; probings here differ by " : ", ") + axis + " " + fixed(rms_um, 1) +
              " um rms";
  return text;
}

/// Compares probings with the claimed error, a line per axis. In 95 % of cases the RMS of few
/// probings is below twice the true sd.
std::string model_error_lines(const ModelStatus& model) {
  constexpr double worse = 2.0;
  std::string text;
  for (const auto& [axis, rms_um] : model.probed_rms_um) {
    const auto claimed = model.claimed_sd_um.find(axis);
    const double sd_um = claimed == model.claimed_sd_um.end() ? not_a_number : claimed->second;
    if (!std::isfinite(rms_um) || !(sd_um > 0)) continue;
    text += line(text.empty() ? "Model error" : "",
                 axis + ": probings differ by " + fixed(rms_um, 1) + " um rms, claimed is " +
                     fixed(sd_um, 1) + " um (1 sd): " +
                     (rms_um <= worse * sd_um
                          ? "as good as claimed"
                          : "WORSE than claimed -> thermocomp diagnose, or remake the model"));
  }
  return text;
}

std::string reference_line(const ReferenceStatus& reference) {
  double low = not_a_number;
  double high = not_a_number;
  for (const auto& [name, temp_degC] : reference.temps_degC) {
    low = std::fmin(low, temp_degC);
    high = std::fmax(high, temp_degC);
  }
  if (!std::isfinite(low)) return line("Reference", "none yet");
  const std::string when = local_time(reference.wall_s);
  std::string text = "it is not known when it was taken";
  if (reference.by == "model_file") text = "the temperatures of the model file";
  if (reference.by == "operator") text = "taken " + when + " by thermocomp reference";
  if (reference.by == "first_values") text = "taken " + when + " from the first values of a start";
  if (reference.by == "reload") text = "changed " + when + " with a reload";
  text += ", at " + fixed(low, 2) + (high > low ? " to " + fixed(high, 2) : "") + " degC";
  return line("Reference", (reference.lost ? "LOST; in its place " : "") + text);
}

std::string model_lines(const ModelStatus& model) {
  std::string file = line("Model", model.file + " (SHA-256 " + model.checksum.substr(0, 16) + ")");
  if (!model.still.empty())
    file += line("", "gives NO DISPLACEMENT of axis " + joined(model.still) +
                         ": all its coefficients are 0");
  if (!model.compared)
    file += line("", "NEVER COMPARED with measured displacement, according to its file" +
                         probed_text(model));
  file += model_error_lines(model);
  if (!model.outside.value_or(false)) return file;
  return file +
         line("Domain", "outside the domain of the model, " +
                            fixed(100.0 * model.outside_share_24h, 0) + " % of the last 24 h");
}

std::string candidate_line(const std::optional<CandidateStatus>& candidate) {
  return candidate ? line("Candidate", candidate_text(*candidate)) : "";
}

std::string cycle_line(const CycleStatus& cycle) {
  return line("Cycle", fixed(cycle.rate_hz, 0) + " Hz, " + std::to_string(cycle.count) +
                           " cycles, " + std::to_string(cycle.missed) + " missed, lateness p50 " +
                           fixed(cycle.lateness_us_p50, 0) + " p99.9 " +
                           fixed(cycle.lateness_us_p999, 0) + " max " +
                           fixed(cycle.lateness_us_max, 0) + " us, work p50 " +
                           fixed(cycle.work_us_p50, 1) + " max " + fixed(cycle.work_us_max, 1) +
                           " us" + (cycle.real_time ? "" : "  [not real-time]"));
}

std::string history_line(const HistoryStatus& history) {
  if (!history.enabled) return line("History", "off");
  std::string text = history.file + ", " + fixed(history.size_MB, 1) + " MB, last commit " +
                     duration_text(history.last_commit_age_s) + " ago";
  if (history.lost_records > 0)
    text += ", " + std::to_string(history.lost_records) + " records lost";
  if (history.errors > 0) text += ", " + std::to_string(history.errors) + " errors";
  return line("History", text);
}

std::string sensor_state(const SensorStatus& sensor, bool colours) {
  // An out-of-range reading is NaN only if the value read was.
  const bool is_nan = sensor.fault == Fault::out_of_range && std::isnan(sensor.raw_degC);
  const CodeText text = is_nan ? nan_text() : fault_text(sensor);
  const bool good = sensor.fault == Fault::none;
  std::string state = coloured(text.meaning,
                               good              ? Colour::green
                               : settles(sensor) ? Colour::yellow
                                                 : Colour::red,
                               colours);
  if (good && sensor.suspected)
    state = coloured("suspected: " + suspicion_text(*sensor.suspected), Colour::yellow, colours);
  if (sensor.jump)
    state += " (jumped by " + fixed_signed(sensor.jump->size_K, 1) + " K at " +
             local_time(sensor.jump->since) + ")";
  if (!text.remedy.empty()) state += " -> " + with_command(text.remedy, text.command);
  return state;
}

std::string count(std::uint64_t value, int width) {
  return fixed(static_cast<double>(value), 0, width);
}

}  // namespace

std::string status_text(const Status& status, bool colours) {
  return headline(status, colours) + trouble_lines(status, colours) + ended_lines(status) +
         axes_lines(status) + inputs_lines(status) + reference_line(status.reference) +
         controller_lines(status.controller) + signals_line(status) + buses_line(status) +
         model_lines(status.model) + candidate_line(status.candidate) + cycle_line(status.cycle) +
         history_line(status.history) +
         line("Daemon", "version " + status.version + ", up " + duration_text(status.uptime_s));
}

std::string score_text(const CandidateStatus& candidate) {
  if (candidate.probings == 0) return "not probed yet";
  std::string text;
  for (const auto& [axis, rms] : candidate.rms_um)
    text += (text.empty() ? "" : ", ") + axis + " leaves " + fixed(rms.candidate, 1) + " of " +
            fixed(rms.model, 1) + " um";
  const bool is_worse = candidate.worse_probability > candidate.better_probability;
  return text + " over " + std::to_string(candidate.probings) +
         (candidate.probings == 1 ? " probing, " : " probings, ") +
         (is_worse ? "worse" : "better") + " with " +
         fixed(100.0 * std::max(candidate.better_probability, candidate.worse_probability), 0) +
         " %";
}

std::string candidate_text(const CandidateStatus& candidate) {
  if (!candidate.problem.empty()) return candidate.file + " does not run: " + candidate.problem;
  return candidate.file + ", " + score_text(candidate);
}

std::string sensors_text(const SensorsAnswer& answer, bool colours) {
  int width = 6;
  for (const SensorStatus& sensor : answer.sensors)
    width = std::max(width, static_cast<int>(sensor.name.size()));
  std::string result =
      padded("sensor", width) + "  raw degC  smoothed  age s  clipped  in a row  rejected  state\n";
  for (const SensorStatus& sensor : answer.sensors)
    result += padded(sensor.name, width) + "  " + fixed(sensor.raw_degC, 2, 8) + "  " +
              fixed(sensor.smoothed_degC, 2, 8) + "  " + fixed(sensor.age_s, 1, 5) + "  " +
              count(sensor.clipped, 7) + "  " + count(sensor.clipped_in_a_row, 8) + "  " +
              count(sensor.rejected, 8) + "  " + sensor_state(sensor, colours) + "\n";
  for (const std::string& estimate : estimate_lines(answer.inputs, answer.axes))
    result += coloured(estimate, Colour::yellow, colours) + "\n";
  return result;
}

}  // namespace thermocomp::cli
