#include "config/model/model_tables.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "config/toml/toml_text.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/model/displacement_model.hpp"

namespace thermocomp {
namespace {

constexpr std::array<const char*, 3> phase_names{"heating", "turned", "cooling"};

/// @return whether rows of gains can be checked
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
                  "must have one value per point (" + std::to_string(phases.size()) + ")");
  const auto rise_K = table.matrix("rise_K", phases.size(), inputs);
  const auto gain = table.matrix("gain", phases.size(), groups);
  const auto sd = table.matrix("gain_sd", phases.size(), groups);
  check_each(table, "rise_K", rise_K, -1e4, 1e4, "must be in [-1e4, 1e4]");
  check_each(table, "gain", gain, 0, 10, "must be in [0, 10]");
  check_each(table, "gain_sd", sd, 0, 10, "must be in [0, 10]");
  std::vector<RecordedCourse::Point> points;
  if (since_s.size() != phases.size() || rise_K.size() != phases.size() ||
      gain.size() != phases.size() || sd.size() != phases.size())
    return points;  // reported already
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

namespace {

constexpr double rows_max = 1e12;
constexpr double spread_min = 1e-9;
constexpr double pivot_share_min = 1e-7;
constexpr double value_max = 1e12;  ///< limit of a value: keeps squares finite

/// The values of an output, each under its key.
struct Figure {
  const char* name;
  double MadeFrom::Output::*value;
};
constexpr std::array<Figure, 6> figures{{
    {"remainder_rms_um", &MadeFrom::Output::remainder_rms_um},
    {"noise_um", &MadeFrom::Output::noise_um},
    {"noise_time_s", &MadeFrom::Output::noise_time_s},
    {"left_out_rms_um", &MadeFrom::Output::left_out_rms_um},
    {"no_model_rms_um", &MadeFrom::Output::no_model_rms_um},
    {"freedom", &MadeFrom::Output::freedom},
}};

std::vector<double> numbers_for(const TomlTable& table, std::string_view key, std::size_t count,
                                const char* of) {
  std::vector<double> values = table.numbers(key, Range::between(-value_max, value_max));
  if (table.has(key) && values.size() != count) {
    table.problem(key, std::to_string(values.size()) + " values",
                  "must have one value " + std::string(of) + " (" + std::to_string(count) + ")");
  }
  return values;
}

/// @return whether shapes that depend on them can be checked
bool read_columns(const TomlTable& table, const ThermalModel& model, MadeFrom& made_from) {
  made_from.columns = table.texts("columns");
  std::vector<std::string> read = model.temperature_columns();
  const std::vector<std::string> signals = model.signal_columns();
  read.insert(read.end(), signals.begin(), signals.end());
  std::set<std::string> seen;
  bool known = !made_from.columns.empty();
  for (const std::string& name : made_from.columns) {
    if (name.empty()) continue;  // reported already
    if (std::find(read.begin(), read.end(), name) == read.end()) {
      table.problem("columns", name, "must be a column that the model reads");
      known = false;
    }
    if (!seen.insert(name).second) {
      table.problem("columns", name, "is named twice");
      known = false;
    }
  }
  if (table.has("columns") && made_from.columns.empty()) {
    table.problem("columns", "must name at least one column");
  }
  if (!known) return false;
  made_from.low = numbers_for(table, "low", made_from.columns.size(), "per column");
  made_from.high = numbers_for(table, "high", made_from.columns.size(), "per column");
  for (std::size_t i = 0; i < std::min(made_from.low.size(), made_from.high.size()); ++i) {
    if (!(made_from.low[i] <= made_from.high[i])) {
      table.problem("high", "must not be below low");
    }
  }
  return true;
}

bool is_positive_definite(const std::vector<std::vector<double>>& rows) {
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd matrix(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      if (!(std::abs(matrix(i, j)) <= value_max)) return false;
    }
  }
  const double largest = matrix.cwiseAbs().maxCoeff();
  if (!((matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * largest)) return false;
  // Pivots relative to the standard deviations: the accuracy of the inverse depends on them.
  const Eigen::LLT<Eigen::MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) return false;
  const Eigen::ArrayXd spread = matrix.diagonal().array().sqrt();
  return (spread >= spread_min).all() &&
         (factor.matrixLLT().diagonal().array() >= pivot_share_min * spread).all();
}

void read_domain(const TomlTable& table, MadeFrom& made_from) {
  made_from.taus_s = table.numbers("tau_s", Range::between(0, term_tau_s_max));
  if (made_from.taus_s.size() > domain_taus_max) {
    table.problem("tau_s", std::to_string(made_from.taus_s.size()) + " values",
                  "must be at most " + std::to_string(domain_taus_max));
  }
  const std::size_t count = domain_features(made_from);
  if (count > domain_features_max) {
    table.problem("columns", std::to_string(count) + " features",
                  "must be at most " + std::to_string(domain_features_max) +
                      ": temperatures, and columns times low passes");
    table.ignore_rest();
    return;
  }
  made_from.mean = numbers_for(table, "mean", count, "per feature");
  made_from.covariance = table.matrix("covariance", count, count);
  if (!made_from.covariance.empty() && !is_positive_definite(made_from.covariance)) {
    table.problem("covariance", "matrix", "must be symmetric and positive definite");
  }
  made_from.distance_max = table.number("distance_max", Range::above(0, value_max));
}

MadeFrom::Output read_output(const TomlTable& table) {
  MadeFrom::Output output;
  for (const auto& [name, value] : figures) {
    const bool is_freedom = value == &MadeFrom::Output::freedom;
    output.*value = table.number(name, Range::between(is_freedom ? 1.0 : 0.0, value_max));
  }
  return output;
}

}  // namespace

MadeFrom read_made_from(const TomlTable& table, const ThermalModel& model) {
  MadeFrom made_from;
  made_from.runs = table.texts("runs");
  made_from.rows = table.number("rows", Range::between(0, rows_max));
  made_from.hours = table.number("hours", Range::between(0, rows_max));
  made_from.within_one_run = table.flag("within_one_run");
  if (!read_columns(table, model, made_from)) {
    table.ignore_rest();
    return made_from;
  }
  read_domain(table, made_from);
  const TomlTable outputs = table.table("output");
  for (const std::string& output : outputs.keys()) {
    if (std::find(model.outputs.begin(), model.outputs.end(), output) == model.outputs.end()) {
      outputs.problem(output, "must be an output of the model");
      continue;
    }
    made_from.outputs[output] = read_output(outputs.table(output));
  }
  return made_from;
}

std::string write_made_from(const ThermalModel& model) {
  const MadeFrom& made_from = *model.made_from;
  std::string text = "[made_from]\nruns = " + toml_list(made_from.runs, toml_string);
  const auto add = [&text](const char* name, const std::string& value) {
    text.append("\n").append(name).append(" = ").append(value);
  };
  add("rows", toml_number(made_from.rows));
  add("hours", toml_number(made_from.hours));
  add("within_one_run", made_from.within_one_run ? "true" : "false");
  add("columns", toml_list(made_from.columns, toml_string));
  add("low", toml_list(made_from.low, toml_number));
  add("high", toml_list(made_from.high, toml_number));
  add("tau_s", toml_list(made_from.taus_s, toml_number));
  add("mean", toml_list(made_from.mean, toml_number));
  add("covariance", toml_rows(made_from.covariance));
  text.append("distance_max = ").append(toml_number(made_from.distance_max)).append("\n");
  if (made_from.outputs.empty()) text += "output = {}\n";
  for (const auto& [name, output] : made_from.outputs) {
    text.append("\n[made_from.output.").append(toml_key(name)).append("]\n");
    for (const auto& [figure, value] : figures)
      text.append(figure).append(" = ").append(toml_number(output.*value)).append("\n");
  }
  return text;
}

}  // namespace thermocomp
