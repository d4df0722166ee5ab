#include "cli/observe/watch_text.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "report/terminal.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace thermocomp::cli {

namespace {

constexpr int column_width = 9;

std::string reasons_text(const Status& status) {
  std::string result;
  for (const Reason reason : by_severity(status.reasons))
    result += (result.empty() ? "" : "; ") + std::string(code_text(reason).meaning);
  if (status.sensors_bad.empty()) return result;
  result += result.empty() ? "bad sensors:" : "; bad sensors:";
  for (const std::string& sensor : status.sensors_bad) result += ' ' + sensor;
  return result;
}

std::string first_line(const Status& status, bool colours) {
  const std::string dry = status.dry_run ? "DRY RUN, nothing is written: " : "";
  return coloured(dry + std::string(code_text(status.mode, status.dry_run).name),
                  is_compensating(status) ? Colour::green : Colour::red, colours) +
         " for " + duration_text(status.mode_since_s) + "   " + fixed(status.cycle.rate_hz, 0) +
         " Hz, " + std::to_string(status.cycle.missed) + " missed, lateness p99.9 " +
         fixed(status.cycle.lateness_us_p999, 0) + " us\n";
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

std::string axes_table(const Status& status, const TruthRow* truth, bool colours,
                       const AxisTrends* trends) {
  std::string result =
      coloured("axis      displacement   target   offset  applied", Colour::bold, colours);
  if (truth != nullptr) {
    result += coloured("   tool error: uncompensated  compensated", Colour::bold, colours);
  }
  result += '\n';
  for (const AxisStatus& axis : status.axes) {
    const std::string name = axis.name;
    result += padded(name + " (" + axis.unit + ")", 9) + fixed_signed(axis.displacement, 2, 13) +
              fixed_signed(axis.target, 2, column_width) +
              fixed_signed(axis.offset, 2, column_width) +
              fixed_signed(axis.applied, 2, column_width);
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

std::string inputs_table(const Status& status, bool colours) {
  const std::vector<InputStatus>& inputs = status.inputs;
  std::size_t width = 12;
  for (const InputStatus& input : inputs) width = std::max(width, input.name.size());
  std::string result =
      coloured(padded("input", static_cast<int>(width)) + "     degC  reference   rise K",
               Colour::bold, colours) +
      '\n';
  for (const InputStatus& input : inputs) {
    result += padded(input.name, static_cast<int>(width)) + fixed(input.temp_degC, 2, 9) +
              fixed(input.reference_degC, 2, 11) +
              fixed_signed(input.temp_degC - input.reference_degC, 2, 9);
    if (input.estimated)
      result += coloured("  estimated +-" + fixed(input.sd_K, 2) + " K", Colour::yellow, colours);
    else if (!input.good)
      result += coloured("  lost", Colour::red, colours);
    result += '\n';
  }
  return result;
}

std::string signals_text(const Status& status) {
  std::string result;
  for (const auto& [name, value] : status.controller.signals)
    result += (result.empty() ? "" : "   ") + name + " " + fixed(value, 1);
  return result.empty() ? "" : result + '\n';
}

// "bed_degC" -> "bed", at most as wide as its column.
std::string short_name(const InputStatus& input) {
  std::string name = input.name;
  if (name.size() > 5 && name.ends_with("_degC")) name.resize(name.size() - 5);
  return name.substr(0, column_width - 1);
}

std::string right(const std::string& text, int width) {
  const int missing = width - static_cast<int>(text.size());
  return std::string(static_cast<std::size_t>(std::max(missing, 0)), ' ') + text;
}

}  // namespace

std::string watch_screen(const Status& status, const TruthRow* truth, bool colours,
                         const AxisTrends* trends) {
  std::string result = first_line(status, colours);
  const std::string reasons = reasons_text(status);
  result += coloured(reasons.empty() ? "nothing wrong" : reasons,
                     reasons.empty() ? Colour::none : Colour::yellow, colours) +
            "\n\n";
  return result + axes_table(status, truth, colours, trends) + '\n' +
         inputs_table(status, colours) + '\n' + signals_text(status);
}

std::string watch_header(const Status& status, const TruthRow* truth) {
  const std::vector<InputStatus>& inputs = status.inputs;
  const std::vector<AxisStatus>& axes = status.axes;
  const int inputs_width = column_width * static_cast<int>(inputs.size());
  const int axes_width = column_width * static_cast<int>(axes.size());
  std::string groups = padded("", 21) + padded("  temperatures degC", inputs_width) + " |" +
                       padded("  offsets um", axes_width);
  std::string names = padded("up s  mode", 21);
  for (const InputStatus& input : inputs) names += right(short_name(input), column_width);
  names += " |";
  for (const AxisStatus& axis : axes) names += right(axis.name, column_width);
  if (truth != nullptr) {
    for (const char* title : {"  tool error without, um", "  tool error with, um"}) {
      groups += " |" + padded(title, axes_width);
      names += " |";
      for (const AxisStatus& axis : axes) names += right(axis.name, column_width);
    }
  }
  return groups + '\n' + names + '\n';
}

std::string watch_line(const Status& status, const TruthRow* truth) {
  const std::vector<AxisStatus>& axes = status.axes;
  std::string result = fixed(status.uptime_s, 0, 4) + "  " +
                       padded(std::string(code_text(status.mode, status.dry_run).name), 15);
  for (const InputStatus& input : status.inputs) {
    result += input.good || input.estimated ? fixed(input.temp_degC, 2, column_width)
                                            : right("lost", column_width);
  }
  result += " |";
  for (const AxisStatus& axis : axes) result += fixed_signed(axis.offset, 2, column_width);
  if (truth != nullptr) {
    std::string without;
    std::string with;
    for (const AxisStatus& axis : axes) {
      const ToolError error = tool_error(*truth, axis.name);
      without += fixed_signed(error.uncompensated_um, 2, column_width);
      with += fixed_signed(error.compensated_um, 2, column_width);
    }
    result += " |" + without + " |" + with;
  }
  const std::string reasons = reasons_text(status);
  return result + (reasons.empty() ? "" : "  " + reasons) + '\n';
}

}  // namespace thermocomp::cli
