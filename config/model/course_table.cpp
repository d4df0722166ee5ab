#include "config/model/course_table.hpp"

#include <algorithm>
#include <array>
#include <set>

#include "config/toml/toml_text.hpp"
#include "estimator/correction_config.hpp"

namespace thermocomp {
namespace {

constexpr std::array<const char*, 3> phase_names{"heating", "turned", "cooling"};

/// @return whether rows of gains can be judged
bool read_groups(const TomlTable& table, const ThermalModel& model, RecordedCourse& course) {
  const std::vector<TomlTable> groups = table.tables("group");
  if (groups.empty() || groups.size() > correction_groups_max) {
    table.problem("group", std::to_string(groups.size()), "must be 1 to 4 groups");
    return false;
  }
  std::set<std::string> named;
  for (const TomlTable& group : groups) {
    course.groups.push_back(group.texts("inputs"));
    for (const std::string& name : course.groups.back()) {
      if (std::find(model.inputs.begin(), model.inputs.end(), name) == model.inputs.end())
        group.problem("inputs", name, "must be an input of the model");
      else if (!named.insert(name).second)
        group.problem("inputs", name, "is named already");
    }
  }
  return true;
}

std::vector<CoursePhase> read_phases(const TomlTable& table) {
  std::vector<CoursePhase> phases;
  for (const std::string& name : table.texts("phase")) {
    const auto* const found = std::find(phase_names.begin(), phase_names.end(), name);
    if (found == phase_names.end())
      table.problem("phase", name, "must be \"heating\", \"turned\" or \"cooling\"");
    phases.push_back(static_cast<CoursePhase>(found - phase_names.begin()));
  }
  return phases;
}

void check_each(const TomlTable& table, const char* key,
                const std::vector<std::vector<double>>& rows, double low, double high,
                const char* rule) {
  for (const auto& row : rows)
    for (const double value : row)
      if (!(value >= low && value <= high)) table.problem(key, toml_number(value), rule);
}

std::vector<RecordedCourse::Point> read_points(const TomlTable& table, std::size_t inputs,
                                               std::size_t groups) {
  const std::vector<CoursePhase> phases = read_phases(table);
  if (table.has("phase") && (phases.empty() || phases.size() > course_points_max)) {
    table.problem("phase", std::to_string(phases.size()) + " points",
                  "must be 1 to " + std::to_string(course_points_max) + " points");
    table.ignore_rest();
    return {};
  }
  const std::vector<double> since_s = table.numbers("since_s", Range::between(0, 1e9));
  if (table.has("since_s") && since_s.size() != phases.size())
    table.problem("since_s", std::to_string(since_s.size()) + " values",
                  "must have one value a point (" + std::to_string(phases.size()) + ")");
  const auto rise_K = table.matrix("rise_K", phases.size(), inputs);
  const auto gain = table.matrix("gain", phases.size(), groups);
  const auto sd = table.matrix("gain_sd", phases.size(), groups);
  check_each(table, "rise_K", rise_K, -1e4, 1e4, "must be in [-1e4, 1e4]");
  check_each(table, "gain", gain, 0, 10, "must be in [0, 10]");
  check_each(table, "gain_sd", sd, 0, 10, "must be in [0, 10]");
  std::vector<RecordedCourse::Point> points;
  if (since_s.size() != phases.size() || rise_K.size() != phases.size() ||
      gain.size() != phases.size() || sd.size() != phases.size())
    return points;  // problems already
  for (std::size_t i = 0; i < phases.size(); ++i)
    points.push_back({phases[i], since_s[i], rise_K[i], gain[i], sd[i]});
  return points;
}

}  // namespace

RecordedCourse read_course(const TomlTable& table, const ThermalModel& model) {
  RecordedCourse course;
  course.runs = table.texts("runs");
  course.bandwidth = table.number("bandwidth", Range::above(0, 100));
  if (!read_groups(table, model, course)) {
    table.ignore_rest();
    return course;
  }
  const TomlTable outputs = table.table("output");
  for (const std::string& output : outputs.keys()) {
    if (std::find(model.outputs.begin(), model.outputs.end(), output) == model.outputs.end()) {
      outputs.problem(output, "must be an output of the model");
      continue;
    }
    course.outputs[output] =
        read_points(outputs.table(output), model.inputs.size(), course.groups.size());
  }
  return course;
}

std::string write_course(const ThermalModel& model) {
  const RecordedCourse& course = *model.course;
  std::string text = "[course]\nruns = " + toml_list(course.runs, toml_string);
  text.append("\nbandwidth = ").append(toml_number(course.bandwidth)).append("\n");
  if (course.outputs.empty()) text += "output = {}\n";
  for (const auto& group : course.groups)
    text.append("\n[[course.group]]\ninputs = ").append(toml_list(group, toml_string)).append("\n");
  for (const auto& [name, points] : course.outputs) {
    std::vector<std::string> phases;
    std::vector<double> since_s;
    std::vector<std::vector<double>> rise_K;
    std::vector<std::vector<double>> gain;
    std::vector<std::vector<double>> sd;
    for (const RecordedCourse::Point& point : points) {
      phases.emplace_back(phase_names.at(static_cast<std::size_t>(point.phase)));
      since_s.push_back(point.since_s);
      rise_K.push_back(point.rise_K);
      gain.push_back(point.gain);
      sd.push_back(point.sd);
    }
    text.append("\n[course.output.").append(toml_key(name)).append("]\nphase = ");
    text.append(toml_list(phases, toml_string)).append("\nsince_s = ");
    text.append(toml_list(since_s, toml_number)).append("\nrise_K = ").append(toml_rows(rise_K));
    text.append("gain = ").append(toml_rows(gain)).append("gain_sd = ").append(toml_rows(sd));
  }
  return text;
}

}  // namespace thermocomp
