#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>

#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {
namespace {

constexpr std::string_view letters = "xyzabc";
constexpr std::string_view form_rule =
    "must be AXIS=COLUMN or AXIS=COLUMN-COLUMN/DISTANCEmm with an axis of x, y, z, a, b, c, or one "
    "of two positions (x1, x2): z=ch5_um, a=ch3_um-ch4_um/150mm";

[[noreturn]] void refuse(const RunFile& run, const std::string& value, std::string rule) {
  throw ConfigurationError({Problem{run.name, 0, "--axis", value, std::move(rule)}});
}

std::string displacement_columns(const RunFile& run) {
  std::string names;
  for (const std::string& column : run.columns)
    if (is_output(column)) names += (names.empty() ? "" : ", ") + column;
  return names.empty() ? "it has no column in um or urad" : "it has " + names;
}

bool is_axis(std::string_view axis) {
  if (axis.empty() || axis.size() > 2 || letters.find(axis[0]) == std::string_view::npos)
    return false;
  return axis.size() == 1 || axis[1] == '1' || axis[1] == '2';
}

std::optional<double> distance_of(std::string_view text) {
  if (!text.ends_with("mm")) return std::nullopt;
  text.remove_suffix(2);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0.0))
    return std::nullopt;
  return value;
}

/// "ch3_um-ch4_um": names may contain a minus, so the separator is the one between two columns.
void take_difference(const RunFile& run, const std::string& value, std::string_view both,
                     AxisBinding& binding) {
  int found = 0;
  for (std::size_t at = both.find('-'); at != std::string_view::npos; at = both.find('-', at + 1)) {
    const std::string_view first = both.substr(0, at);
    const std::string_view second = both.substr(at + 1);
    if (!run.find(first) || !run.find(second)) continue;
    binding.column = first;
    binding.less = second;
    ++found;
  }
  if (found != 1)
    refuse(run, value,
           "must name two columns of the file with one - between; " + displacement_columns(run));
}

AxisBinding parsed(const RunFile& run, const std::string& value) {
  const std::size_t equals = value.find('=');
  if (equals == std::string::npos || !is_axis(value.substr(0, equals)))
    refuse(run, value, std::string(form_rule));
  AxisBinding binding{value.substr(0, equals), value.substr(equals + 1), "", 0.0};
  if (!run.find(binding.column)) {
    const std::size_t slash = binding.column.rfind('/');
    if (slash == std::string::npos)
      refuse(run, value, "is not a column of the file; " + displacement_columns(run));
    const auto distance_mm = distance_of(std::string_view(binding.column).substr(slash + 1));
    if (!distance_mm) refuse(run, value, std::string(form_rule));
    binding.distance_mm = *distance_mm;
    const std::string both = binding.column.substr(0, slash);
    take_difference(run, value, both, binding);
  }
  for (const std::string& column : {binding.column, binding.less}) {
    const bool fits =
        binding.less.empty() ? is_output(column) : kind_of(column) == QuantityKind::displacement;
    if (!column.empty() && !fits)
      refuse(run, value,
             binding.less.empty() ? "must be a column in um or urad; " + displacement_columns(run)
                                  : "must be made of two columns in um");
  }
  return binding;
}

bool has_a_course(const RunFile& run, const std::string& column) {
  const auto& values = run.column(column);
  std::size_t count = 0;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row)
    if (std::isfinite(values[row])) ++count;
  return count >= 2;
}

/// The column named like an axis: measured at the tool, or a displacement. Skips columns without a
/// course: a history has columns of all axes, measured or not.
std::optional<std::string> column_called(const RunFile& run, const std::string& axis) {
  for (const char* end : {"_measured_um", "_um", "_measured_urad", "_urad"})
    for (const std::string& column : run.columns) {
      std::string lower = column;
      std::transform(lower.begin(), lower.end(), lower.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (lower == axis + end && has_a_course(run, column)) return column;
    }
  return std::nullopt;
}

std::vector<AxisBinding> by_names(const RunFile& run, const TestOptions& options) {
  std::vector<AxisBinding> bindings;
  const auto add = [&](const std::string& axis, const std::string& called) {
    const auto column = column_called(run, called);
    if (column) bindings.push_back({axis, *column, "", 0.0});
    return column.has_value();
  };
  for (const char letter : letters) {
    const std::string axis(1, letter);
    if (add(axis, axis)) continue;
    add(options.kind == TestKind::axis ? axis + "1" : axis, axis + "1");
    if (options.kind == TestKind::axis) add(axis + "2", axis + "2");
  }
  if (options.kind == TestKind::axis || !(options.distance_mm > 0.0)) return bindings;
  // Two probes along the test bar: across X they give the tilt about Y, across Y that about X.
  for (const auto& [tilt, across] : {std::pair<const char*, const char*>{"a", "y"}, {"b", "x"}}) {
    const auto first = column_called(run, std::string(across) + "1");
    const auto second = column_called(run, std::string(across) + "2");
    if (first && second && !column_called(run, tilt))
      bindings.push_back({tilt, *first, *second, options.distance_mm});
  }
  return bindings;
}

}  // namespace

std::vector<AxisBinding> bind_axes(const RunFile& run, const TestOptions& options) {
  std::vector<AxisBinding> bindings;
  for (const std::string& value : options.axes) {
    bindings.push_back(parsed(run, value));
    const auto same =
        std::count_if(bindings.begin(), bindings.end(),
                      [&](const AxisBinding& other) { return other.axis == bindings.back().axis; });
    if (same > 1) refuse(run, value, "repeats the axis of another --axis");
  }
  if (options.axes.empty()) bindings = by_names(run, options);
  if (bindings.empty())
    refuse(run, "(missing)",
           "no column named like an axis (x_um ... c_urad) has two values in the selected rows; " +
               displacement_columns(run) +
               ": assign columns with --axis z=COLUMN; a history gets values by thermocomp "
               "measured AXIS UM");
  return bindings;
}

std::string axis_words(const std::string& axis) {
  std::string words(1, static_cast<char>(std::toupper(static_cast<unsigned char>(axis[0]))));
  if (axis.size() > 1) words.append(" at position ").append(axis.substr(1));
  return words;
}

}  // namespace thermocomp::thermal_test
