#include "modelling/thermal_test/test_data.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string_view>

#include "config/runs/model_inputs.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"

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

/// The column named like an axis: measured at the tool, or a displacement. Columns without a course
/// are skipped, since a history has columns of all axes, measured or not.
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

namespace {

/// Share of the largest speed below which the machine stands still.
constexpr double speed_share = 0.02;
constexpr double moved_mm = 0.01;
constexpr double urad_per_um_per_mm = 1000.0;

[[noreturn]] void refuse(const RunFile& run, const std::string& key, const std::string& value,
                         std::string rule) {
  throw ConfigurationError({Problem{run.name, 0, key, value, std::move(rule)}});
}

std::string hours_text(double seconds) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f h", seconds / 3600.0);
  return text;
}

MeasuredCourse course_of(const RunFile& run, const AxisBinding& binding) {
  const auto& time_s = run.time_s();
  const auto& first = run.column(binding.column);
  const auto* second = binding.less.empty() ? nullptr : &run.column(binding.less);
  MeasuredCourse course;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    double value = first[row];
    if (second != nullptr)
      value = (value - (*second)[row]) / binding.distance_mm * urad_per_um_per_mm;
    if (!std::isfinite(value)) continue;
    course.time_s.push_back(time_s[row]);
    course.value.push_back(value);
  }
  return course;
}

TestAxis axis_of(const RunFile& run, const AxisBinding& binding, const TestOptions& options) {
  const bool tilts = !binding.less.empty() || kind_of(binding.column) == QuantityKind::tilt;
  const bool is_second = binding.axis.size() > 1 && binding.axis[1] == '2';
  TestAxis axis{axis_words(binding.axis), binding.column,   tilts ? "urad" : "um",
                !tilts && !is_second,     options.noise_um, course_of(run, binding)};
  if (!binding.less.empty()) {
    char text[48];
    std::snprintf(text, sizeof text, ", %g mm apart", binding.distance_mm);
    axis.from.append(" less ").append(binding.less).append(text);
    // Noise of two probes.
    if (axis.noise >= 0.0) axis.noise *= std::sqrt(2.0) * urad_per_um_per_mm / binding.distance_mm;
  } else if (tilts) {
    axis.noise = -1.0;
  }
  if (axis.measured.value.size() < 2)
    refuse(run, binding.column, "(missing)", "has fewer than two values in the selected rows");
  return axis;
}

/// Adds the growth of the distance between two measured positions of a linear axis.
void add_growths(const RunFile& run, const std::vector<AxisBinding>& bindings,
                 const TestOptions& options, std::vector<TestAxis>& axes) {
  if (options.kind != TestKind::axis) return;
  for (const AxisBinding& second : bindings) {
    if (second.axis.size() < 2 || second.axis[1] != '2') continue;
    for (const AxisBinding& first : bindings) {
      if (first.axis != second.axis.substr(0, 1) + "1") continue;
      // Over 1000 mm, a difference in micrometres equals the angle in microradians.
      AxisBinding growth{second.axis, second.column, first.column, urad_per_um_per_mm};
      TestAxis axis = axis_of(run, growth, options);
      axis.name = axis_words(second.axis.substr(0, 1)) + ", growth from position 1 to 2";
      axis.from = second.column + " less " + first.column;
      axis.unit = "um";
      axes.push_back(std::move(axis));
    }
  }
}

std::optional<std::string> column_of_unit(const RunFile& run, std::string_view suffix) {
  std::string found;
  for (const std::string& column : run.columns) {
    if (unit_of(column).suffix != suffix) continue;
    if (!found.empty())
      refuse(run, "--running", std::string(found).append(" or ").append(column),
             "both could define when it ran: choose one, --running " + found);
    found = column;
  }
  if (found.empty()) return std::nullopt;
  return found;
}

/// Rows in which the machine ran; a missing value repeats the previous state.
std::vector<bool> active_rows(const RunFile& run, const std::string& column) {
  const auto& values = run.column(column);
  const bool moves = kind_of(column) == QuantityKind::position;
  double largest = 0.0;
  for (const double value : values)
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  std::vector<bool> active;
  bool now = false;
  double last = not_a_number;
  for (const double value : values) {
    if (std::isfinite(value)) {
      now = moves ? std::abs(value - last) > moved_mm : std::abs(value) > speed_share * largest;
      last = value;
    }
    active.push_back(now);
  }
  return active;
}

double number_or_refuse(const RunFile& run, const std::string& whole, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    refuse(run, "--running", whole, "must be a column of the file, or T0:T1 in seconds");
  return value;
}

void phases_from_times(const RunFile& run, const std::string& running, TestPhases& phases) {
  const std::size_t colon = running.find(':');
  phases.running_from_s = number_or_refuse(run, running, running.substr(0, colon));
  phases.running_to_s = number_or_refuse(run, running, running.substr(colon + 1));
  if (!(phases.from_s <= phases.running_from_s && phases.running_from_s < phases.running_to_s &&
        phases.running_to_s <= phases.to_s))
    refuse(run, "--running", running,
           "must be within the record, which is " + std::to_string(phases.from_s) + ":" +
               std::to_string(phases.to_s));
  phases.description = "It ran from " + hours_text(phases.running_from_s) + " to " +
                       hours_text(phases.running_to_s) + " (--running)";
}

void phases_from_column(const RunFile& run, const std::string& column, TestPhases& phases) {
  const auto& time_s = run.time_s();
  const std::vector<bool> active = active_rows(run, column);
  std::size_t first = run.selected_begin;
  while (first < run.selected_end && !active[first]) ++first;
  if (first == run.selected_end)
    refuse(run, column, "(0)",
           "is always 0 in the selected rows: choose another, --running COLUMN");
  std::size_t last = run.selected_end - 1;
  while (!active[last]) --last;
  phases.running_from_s = time_s[first > run.selected_begin ? first - 1 : first];
  phases.running_to_s = time_s[last];
  if (!(phases.running_to_s > phases.running_from_s))
    refuse(run, column, "(one row)", "is nonzero in one row only");
  phases.description = "It ran from " + hours_text(phases.running_from_s) + " to " +
                       hours_text(phases.running_to_s) + " (" + column + ")";
}

/// Column that shows when it ran; empty: given by times.
std::string running_column(const RunFile& run, const TestOptions& options) {
  if (!options.running.empty()) {
    if (run.find(options.running)) return options.running;
    if (options.running.find(':') != std::string::npos) return "";
    refuse(run, "--running", options.running, "must be a column of the file, or T0:T1 in seconds");
  }
  const bool spindle = options.kind == TestKind::spindle;
  auto column = column_of_unit(run, spindle ? "_rpm" : "_mm_per_min");
  if (!column && !spindle) column = column_of_unit(run, "_mm");
  if (!column)
    refuse(run, "--running", "(missing)",
           std::string("no column in ") + (spindle ? "rpm" : "mm/min or mm") +
               " shows when it ran: give --running COLUMN or --running T0:T1 in seconds");
  return *column;
}

void read_speed(const RunFile& run, const std::string& column, TestData& data) {
  const auto& time_s = run.time_s();
  const auto& values = run.column(column);
  data.speed_name = column;
  double largest = 0.0;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    if (!std::isfinite(values[row])) continue;
    data.speed_time_s.push_back(time_s[row]);
    data.speed.push_back(values[row]);
    largest = std::max(largest, std::abs(values[row]));
  }
  if (data.speed.empty() || kind_of(column) == QuantityKind::position) return;
  double steady_speed = data.speed.front();
  for (std::size_t i = 1; i < data.speed.size(); ++i) {
    if (!(std::abs(data.speed[i] - steady_speed) > speed_share * largest)) continue;
    steady_speed = data.speed[i];
    data.breaks_s.push_back(data.speed_time_s[i]);
  }
}

std::vector<TestTemperature> temperatures_of(const RunFile& run, const std::string& room) {
  if (!room.empty() && !(run.find(room) && unit_of(room).suffix == "_degC"))
    refuse(run, "--room", room, "must be a column of the file in degC");
  std::vector<TestTemperature> temperatures;
  for (const std::string& column : run.columns) {
    if (unit_of(column).suffix != "_degC") continue;
    TestTemperature temperature{column.substr(0, column.size() - 5), {}, {}, false};
    temperature.is_room = room.empty() ? is_called_like_a_room(column) : column == room;
    const auto& values = run.column(column);
    for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
      if (!std::isfinite(values[row])) continue;
      temperature.time_s.push_back(run.time_s()[row]);
      temperature.temp_degC.push_back(values[row]);
    }
    if (!temperature.time_s.empty()) temperatures.push_back(std::move(temperature));
  }
  return temperatures;
}

}  // namespace

std::string to_string(TestKind kind) {
  if (kind == TestKind::environment) return "environment";
  return kind == TestKind::spindle ? "spindle" : "axis";
}

namespace {

/// Displacement counts anew from a reference.
void refuse_new_reference(const RunFile& run) {
  const auto is_measured_before = [&](std::size_t row) {
    for (std::size_t i = 0; i < run.columns.size(); ++i)
      if (is_output(run.columns[i]) && !run.columns[i].ends_with("_offset_um") &&
          !run.columns[i].ends_with("_applied_um"))
        for (std::size_t each = run.selected_begin; each < row; ++each)
          if (std::isfinite(run.values[i][each])) return true;
    return false;
  };
  for (const std::size_t row : run.references)
    if (row > run.selected_begin && row < run.selected_end && is_measured_before(row))
      refuse(run, "selection", selected_name(run),
             "must not contain a new reference, such as at " + number_text(run.time_s()[row]) +
                 " s: displacement counts anew from there");
}

std::optional<bool> is_compensated(const RunFile& run) {
  std::optional<bool> compensated;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!run.columns[i].ends_with("_applied_um")) continue;  // an offset may be a dry run's
    for (std::size_t row = run.selected_begin; row < run.selected_end; ++row)
      if (std::isfinite(run.values[i][row]))
        compensated = compensated.value_or(false) || run.values[i][row] != 0.0;
  }
  return compensated;
}

}  // namespace

TestData test_data(const RunFile& given, const TestOptions& options) {
  refuse_new_reference(given);
  TestData data;
  RunFile run = given;
  std::vector<std::string> outputs;
  std::copy_if(run.columns.begin(), run.columns.end(), std::back_inserter(outputs),
               [](const std::string& column) { return is_output(column); });
  for (const Outliers& each : leave_out_outliers(run, outputs))
    data.description.push_back(each.text());
  data.kind = options.kind;
  data.file = selected_name(run);
  data.phases.from_s = run.time_s()[run.selected_begin];
  data.phases.to_s = run.time_s()[run.selected_end - 1];
  const std::vector<AxisBinding> bindings = bind_axes(run, options);
  for (const AxisBinding& binding : bindings) {
    TestAxis axis = axis_of(run, binding, options);
    const auto [least, most] =
        std::minmax_element(axis.measured.value.begin(), axis.measured.value.end());
    if (*least < *most)
      data.axes.push_back(std::move(axis));
    else
      data.left_out.push_back(axis.name + " (" + axis.from + ") is left out: all its values are " +
                              "the same, so the probe shows nothing");
  }
  if (data.axes.empty() && !data.left_out.empty())
    throw ConfigurationError({Problem{run.name, 0, "", "", data.left_out.front()}});
  data.description.insert(data.description.end(), data.left_out.begin(), data.left_out.end());
  add_growths(run, bindings, options, data.axes);
  for (const TestAxis& axis : data.axes)
    data.description.push_back(axis.name + " is " + axis.from + ", " +
                               std::to_string(axis.measured.value.size()) + " values");
  data.temperatures = temperatures_of(run, options.room);
  data.compensated = is_compensated(run);
  if (options.kind == TestKind::environment) {
    if (!options.running.empty())
      refuse(run, "--running", options.running, "must be omitted in a test of the environment");
    if (const auto speed = run.find("spindle_rpm")) read_speed(run, "spindle_rpm", data);
    return data;
  }
  data.phases.runs = true;
  const std::string column = running_column(run, options);
  if (column.empty()) {
    phases_from_times(run, options.running, data.phases);
    data.breaks_s = {data.phases.running_from_s, data.phases.running_to_s};
  } else {
    phases_from_column(run, column, data.phases);
    read_speed(run, column, data);
  }
  data.description.push_back(data.phases.description);
  return data;
}

}  // namespace thermocomp::thermal_test
