#include "cli/observe/watch_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "estimator/types.hpp"
#include "report/terminal.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace thermocomp::cli {
namespace {

constexpr std::array<const char*, 8> wide_bars{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<const char*, 8> plain_bars{"_", ".", ":", "-", "=", "+", "*", "#"};
/// Smallest range of the bars, so that noise does not look like movement.
constexpr double range_um_min = 0.5;
constexpr double still_um_per_min = 0.05;
constexpr double fast_um_per_min = 1.0;

}  // namespace

void AxisTrends::add(const Status& status) {
  const double now_s = status.uptime_s;
  if (!std::isfinite(now_s)) return;
  for (const AxisStatus& axis : status.axes) {
    std::deque<Sample>& samples = axes_[axis.name];
    if (!samples.empty() && now_s < samples.back().time_s) samples.clear();
    if (std::isfinite(axis.offset)) samples.push_back({now_s, axis.offset});
    while (!samples.empty() && samples.front().time_s < now_s - window_s) samples.pop_front();
  }
}

std::string AxisTrends::text(const std::string& axis) const {
  const auto found = axes_.find(axis);
  if (found == axes_.end() || found->second.size() < 2) return "";
  return bars(found->second) + " " + arrow(found->second);
}

std::string AxisTrends::bars(const std::deque<Sample>& samples) const {
  double low = samples.front().offset;
  double high = low;
  for (const Sample& sample : samples) {
    low = std::min(low, sample.offset);
    high = std::max(high, sample.offset);
  }
  const double middle = 0.5 * (low + high);
  const double range = std::max(range_um_min, high - low);
  const std::size_t count = std::min(cells, samples.size());
  std::string text;
  for (std::size_t cell = 0; cell < count; ++cell) {
    // The last value of each equal part, so that the newest is always shown.
    const Sample& sample = samples[(cell + 1) * samples.size() / count - 1];
    // Off the boundary of two levels, where a constant value would flicker.
    const double height = 3.01 + 7.0 * (sample.offset - middle) / range;
    const auto level = static_cast<std::size_t>(std::clamp(std::lround(height), 0L, 7L));
    text += wide_ ? wide_bars.at(level) : plain_bars.at(level);
  }
  return text;
}

const char* AxisTrends::arrow(const std::deque<Sample>& samples) const {
  const double minutes = (samples.back().time_s - samples.front().time_s) / 60.0;
  const double rate =
      minutes > 0.0 ? (samples.back().offset - samples.front().offset) / minutes : 0.0;
  if (std::abs(rate) < still_um_per_min) return wide_ ? "→" : "steady";
  if (rate > 0.0) {
    if (rate < fast_um_per_min) return wide_ ? "↗" : "rising";
    return wide_ ? "↑" : "rising fast";
  }
  if (rate > -fast_um_per_min) return wide_ ? "↘" : "falling";
  return wide_ ? "↓" : "falling fast";
}

bool terminal_is_wide() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    std::string locale(value);
    std::transform(locale.begin(), locale.end(), locale.begin(), [](unsigned char c) {
      return static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
    });
    return locale.find("UTF-8") != std::string::npos || locale.find("UTF8") != std::string::npos;
  }
  return false;
}

namespace {

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  return fields;
}

double number_in(const std::string& field) {
  double value = 0.0;
  const auto result = std::from_chars(field.data(), field.data() + field.size(), value);
  return result.ec == std::errc() ? value : not_a_number;
}

double value_of(const std::vector<std::string>& columns, const std::vector<double>& values,
                const std::string& column) {
  const auto found = std::find(columns.begin(), columns.end(), column);
  const auto index = static_cast<std::size_t>(found - columns.begin());
  return index < values.size() ? values[index] : not_a_number;
}

}  // namespace

double TruthRow::value(const std::string& column) const {
  return value_of(columns, values, column);
}

double TruthRow::change(const std::string& column) const {
  return value_of(columns, values, column) - value_of(columns, first, column);
}

TruthFile::TruthFile(std::filesystem::path path) : path_(std::move(path)) {}

const TruthRow* TruthFile::newest() {
  if (!file_.is_open()) file_.open(path_);
  file_.clear();
  char buffer[4096];
  while (file_.read(buffer, sizeof buffer), file_.gcount() > 0) {
    unfinished_.append(buffer, static_cast<std::size_t>(file_.gcount()));
  }
  for (auto end = unfinished_.find('\n'); end != std::string::npos; end = unfinished_.find('\n')) {
    take_line(unfinished_.substr(0, end));
    unfinished_.erase(0, end + 1);
  }
  return row_.values.empty() ? nullptr : &row_;
}

void TruthFile::take_line(const std::string& line) {
  if (line.empty() || line.front() == '#') return;
  const std::vector<std::string> fields = fields_of(line);
  if (row_.columns.empty()) {
    row_.columns = fields;
    return;
  }
  row_.values.clear();
  for (const std::string& field : fields) row_.values.push_back(number_in(field));
  if (row_.first.empty()) row_.first = row_.values;
}

namespace {

constexpr int column_width = 9;
constexpr double begun_s = 5.0;

std::string reasons_text(const Status& status) {
  std::string result;
  for (const Reason reason : by_severity(status.reasons))
    result += (result.empty() ? "" : "; ") + std::string(code_text(reason).meaning);
  const std::string way = is_compensating(status) ? verdict(status).advice : "";
  if (!way.empty()) result += (result.empty() ? "" : "; ") + way;
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

// Tool error without and with the offsets, from the truth file of a simulated machine, which names
// its outputs after the axes: x_um, x_error_um.
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

// "bed_degC" -> "bed", cut to the column's width.
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
  // The first readings arrive within some seconds.
  const bool just_begun = status.mode == Mode::starting && status.uptime_s < begun_s;
  const std::string reasons = just_begun ? "" : reasons_text(status);
  return result + (reasons.empty() ? "" : "  " + reasons) + '\n';
}

std::string WatchLog::next(const Status& status, const TruthRow* truth) {
  const bool has_truth = truth != nullptr;
  std::string lines = has_truth_ == has_truth ? "" : watch_header(status, truth);
  has_truth_ = has_truth;
  return lines + watch_line(status, truth);
}

}  // namespace thermocomp::cli
