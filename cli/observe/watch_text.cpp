#include "cli/observe/watch_text.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/common/terminal.hpp"
#include "cli/observe/troubles.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;

constexpr int column_width = 9;

std::string unit_of_axis(const json& axis) {
  const std::string unit = text_of(axis, "unit");
  return unit.empty() ? "um" : unit;
}

std::string reasons_text(const json& status) {
  std::string result;
  for (const json& reason : list_of(status, "reasons")) {
    const std::string name = reason.is_string() ? reason.get<std::string>() : reason.dump();
    result += (result.empty() ? "" : "; ") + std::string(reason_text(name).meaning);
  }
  const json& bad = list_of(status, "sensors_bad");
  for (std::size_t i = 0; i < bad.size(); ++i) {
    if (i == 0) result += result.empty() ? "bad sensors:" : "; bad sensors:";
    result += ' ';
    result += bad[i].is_string() ? bad[i].get<std::string>() : bad[i].dump();
  }
  return result;
}

std::string first_line(const json& status, bool colours) {
  const bool good = is_compensating(status);
  const json& cycle = object_of(status, "cycle");
  const std::string dry = flag_of(status, "dry_run") ? "DRY RUN, nothing is written: " : "";
  return coloured(dry + text_of(status, "mode"), good ? Colour::green : Colour::red, colours) +
         " for " + duration_text(number_of(status, "mode_since_s")) + "   " +
         fixed(number_of(cycle, "rate_hz"), 0) + " Hz, " + fixed(number_of(cycle, "missed"), 0) +
         " missed, lateness p99.9 " + fixed(number_of(cycle, "lateness_us_p999"), 0) + " us\n";
}

// What the tool does without and with the offsets, as the simulated machine knows it. Its truth
// file calls the outputs like the axes: x_um, x_error_um.
struct ToolError {
  double uncompensated_um;
  double compensated_um;
};

ToolError tool_error(const TruthRow& truth, const std::string& axis) {
  return {truth.change(axis + "_um"), truth.value(axis + "_error_um")};
}

std::string axes_table(const json& status, const TruthRow* truth, bool colours,
                       const AxisTrends* trends) {
  std::string result =
      coloured("axis      displacement   target   offset  applied", Colour::bold, colours);
  if (truth != nullptr) {
    result += coloured("   tool error: uncompensated  compensated", Colour::bold, colours);
  }
  result += '\n';
  for (const json& axis : list_of(status, "axes")) {
    const std::string name = text_of(axis, "name");
    result += padded(name + " (" + unit_of_axis(axis) + ")", 9) +
              fixed_signed(number_of(axis, "displacement"), 2, 13) +
              fixed_signed(number_of(axis, "target"), 2, column_width) +
              fixed_signed(number_of(axis, "offset"), 2, column_width) +
              fixed_signed(number_of(axis, "applied"), 2, column_width);
    if (truth != nullptr) {
      const ToolError error = tool_error(*truth, name);
      result += fixed_signed(error.uncompensated_um, 2, 28) +
                coloured(fixed_signed(error.compensated_um, 2, 13), Colour::green, colours);
    }
    if (trends != nullptr) result += "   " + trends->text(name);
    result += '\n';
  }
  return result;
}

std::string inputs_table(const json& status, bool colours) {
  const json& inputs = list_of(status, "inputs");
  std::size_t width = 12;
  for (const json& input : inputs) width = std::max(width, text_of(input, "name").size());
  std::string result =
      coloured(padded("input", static_cast<int>(width)) + "     degC  reference   rise K",
               Colour::bold, colours) +
      '\n';
  for (const json& input : inputs) {
    const double temp_degC = number_of(input, "temp_degC");
    const double reference_degC = number_of(input, "reference_degC");
    result += padded(text_of(input, "name"), static_cast<int>(width)) + fixed(temp_degC, 2, 9) +
              fixed(reference_degC, 2, 11) + fixed_signed(temp_degC - reference_degC, 2, 9);
    if (flag_of(input, "estimated"))
      result += coloured("  estimated +-" + fixed(number_of(input, "sd_K"), 2) + " K",
                         Colour::yellow, colours);
    else if (!flag_of(input, "good"))
      result += coloured("  lost", Colour::red, colours);
    result += '\n';
  }
  return result;
}

std::string signals_text(const json& status) {
  std::string result;
  for (const auto& [name, value] : object_of(object_of(status, "controller"), "signals").items()) {
    const double number = value.is_number() ? value.get<double>() : std::nan("");
    result += (result.empty() ? "" : "   ") + name + " " + fixed(number, 1);
  }
  return result.empty() ? "" : result + '\n';
}

// "bed_degC" -> "bed", at most as wide as its column.
std::string short_name(const json& input) {
  std::string name = text_of(input, "name");
  if (name.size() > 5 && name.ends_with("_degC")) name.resize(name.size() - 5);
  return name.substr(0, column_width - 1);
}

std::string right(const std::string& text, int width) {
  const int missing = width - static_cast<int>(text.size());
  return std::string(static_cast<std::size_t>(std::max(missing, 0)), ' ') + text;
}

}  // namespace

std::string watch_screen(const json& status, const TruthRow* truth, bool colours,
                         const AxisTrends* trends) {
  std::string result = first_line(status, colours);
  const std::string reasons = reasons_text(status);
  result += coloured(reasons.empty() ? "nothing wrong" : reasons,
                     reasons.empty() ? Colour::none : Colour::yellow, colours) +
            "\n\n";
  return result + axes_table(status, truth, colours, trends) + '\n' +
         inputs_table(status, colours) + '\n' + signals_text(status);
}

std::string watch_header(const json& status, const TruthRow* truth) {
  const json& inputs = list_of(status, "inputs");
  const json& axes = list_of(status, "axes");
  const int inputs_width = column_width * static_cast<int>(inputs.size());
  const int axes_width = column_width * static_cast<int>(axes.size());
  std::string groups = padded("", 21) + padded("  temperatures degC", inputs_width) + " |" +
                       padded("  offsets um", axes_width);
  std::string names = padded("up s  mode", 21);
  for (const json& input : inputs) names += right(short_name(input), column_width);
  names += " |";
  for (const json& axis : axes) names += right(text_of(axis, "name"), column_width);
  if (truth != nullptr) {
    for (const char* title : {"  tool error without, um", "  tool error with, um"}) {
      groups += " |" + padded(title, axes_width);
      names += " |";
      for (const json& axis : axes) names += right(text_of(axis, "name"), column_width);
    }
  }
  return groups + '\n' + names + '\n';
}

std::string watch_line(const json& status, const TruthRow* truth) {
  const json& axes = list_of(status, "axes");
  std::string result = fixed(number_of(status, "uptime_s"), 0, 4) + "  " +
                       padded(text_of(status, "mode").substr(0, 15), 15);
  for (const json& input : list_of(status, "inputs")) {
    result += flag_of(input, "good") || flag_of(input, "estimated")
                  ? fixed(number_of(input, "temp_degC"), 2, column_width)
                  : right("lost", column_width);
  }
  result += " |";
  for (const json& axis : axes) result += fixed_signed(number_of(axis, "offset"), 2, column_width);
  if (truth != nullptr) {
    std::string without;
    std::string with;
    for (const json& axis : axes) {
      const ToolError error = tool_error(*truth, text_of(axis, "name"));
      without += fixed_signed(error.uncompensated_um, 2, column_width);
      with += fixed_signed(error.compensated_um, 2, column_width);
    }
    result += " |" + without + " |" + with;
  }
  const std::string reasons = reasons_text(status);
  return result + (reasons.empty() ? "" : "  " + reasons) + '\n';
}

}  // namespace thermocomp::cli
