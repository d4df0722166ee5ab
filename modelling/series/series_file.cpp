// Files of a series and of a machine's statistics.
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "config/model/model_file.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"
#include "config/toml/toml_text.hpp"
#include "modelling/series/series.hpp"

namespace thermocomp::series {
namespace {

constexpr double value_max = 1e18;
const Range any_value = Range::between(-value_max, value_max);
const Range not_negative = Range::between(0.0, value_max);

std::vector<double> list_of(const Eigen::VectorXd& values) {
  return {values.begin(), values.end()};
}

std::vector<std::vector<double>> rows_of(const Eigen::MatrixXd& matrix) {
  std::vector<std::vector<double>> rows;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    rows.push_back(list_of(matrix.row(i).transpose()));
  return rows;
}

void add(std::string& text, const char* key, const std::string& value) {
  text.append(key).append(" = ").append(value).append("\n");
}

void add_columns(std::string& text, const Columns& columns) {
  const auto list = [&](const char* key, double Subject::*member) {
    std::vector<double> values;
    for (const Subject& each : columns.subjects) values.push_back(each.*member);
    add(text, key, toml_list(values, toml_number));
  };
  std::vector<std::string> names;
  for (const Subject& each : columns.subjects) names.push_back(each.name);
  add(text, "subjects", toml_list(names, toml_string));
  list("powers", &Subject::power);
  list("low", &Subject::low);
  list("high", &Subject::high);
  list("rise_low", &Subject::rise_low);
  list("rise_high", &Subject::rise_high);
  std::vector<std::string> unmoved;
  for (const Subject& each : columns.subjects)
    if (!each.moved && each.power == 1.0) unmoved.push_back(each.name);
  add(text, "unmoved", toml_list(unmoved, toml_string));
  add(text, "tau_s", toml_list(columns.taus_s, toml_number));
}

Eigen::VectorXd vector_of(const TomlTable& table, const char* key, Eigen::Index count,
                          Range range = any_value) {
  const std::vector<double> values = table.numbers(key, range);
  if (table.has(key) && static_cast<Eigen::Index>(values.size()) != count)
    table.problem(key, std::to_string(values.size()) + " values",
                  "must have " + std::to_string(count));
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(count);
  for (Eigen::Index i = 0; i < std::min(count, static_cast<Eigen::Index>(values.size())); ++i)
    vector[i] = values[static_cast<std::size_t>(i)];
  return vector;
}

Eigen::MatrixXd matrix_of(const TomlTable& table, const char* key, Eigen::Index rows,
                          Eigen::Index columns) {
  const auto values =
      table.matrix(key, static_cast<std::size_t>(rows), static_cast<std::size_t>(columns));
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(rows, columns);
  for (std::size_t i = 0; i < values.size(); ++i)
    for (std::size_t j = 0; j < values[i].size(); ++j)
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = values[i][j];
  return matrix;
}

Columns read_columns(const TomlTable& root) {
  Columns columns;
  const std::vector<std::string> names = root.texts("subjects");
  if (root.has("subjects") && names.empty()) root.problem("subjects", "must name at least one");
  const auto count = static_cast<Eigen::Index>(names.size());
  const Eigen::VectorXd powers = vector_of(root, "powers", count, Range::between(1.0, 2.0));
  const Eigen::VectorXd low = vector_of(root, "low", count);
  const Eigen::VectorXd high = vector_of(root, "high", count);
  const Eigen::VectorXd rise_low = vector_of(root, "rise_low", count);
  const Eigen::VectorXd rise_high = vector_of(root, "rise_high", count);
  bool signals = false;
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::string& name = names[static_cast<std::size_t>(i)];
    if (columns.find(name, powers[i]) >= 0) root.problem("subjects", name, "is named twice");
    if (!is_temperature(name) && !is_operating(name))
      root.problem("subjects", name, "must be a temperature or an operating signal");
    if (signals && is_temperature(name))
      root.problem("subjects", name, "temperatures must come before signals");
    signals = signals || !is_temperature(name);
    if (!(low[i] <= high[i]) || !(rise_low[i] <= rise_high[i]))
      root.problem("high", "must not be below low");
    columns.subjects.push_back({name, powers[i], low[i], high[i], rise_low[i], rise_high[i], true});
  }
  for (const std::string& name : root.texts("unmoved"))
    for (Subject& each : columns.subjects)
      if (each.name == name) each.moved = false;
  columns.taus_s = root.numbers("tau_s", Range::between(0, term_tau_s_max));
  if (!columns.taus_s.empty() &&
      (columns.taus_s.front() != 0.0 ||
       std::adjacent_find(columns.taus_s.begin(), columns.taus_s.end(), std::greater_equal<>()) !=
           columns.taus_s.end()))
    root.problem("tau_s", "must begin with 0 and ascend");
  return columns;
}

TomlTable root_of(const TomlDocument& document, const char* kind) {
  const TomlTable root = document.root();
  (void)root.integer("format", 1, 1);
  if (root.text("kind") != kind)
    root.problem("kind", std::string("must be \"").append(kind).append("\""));
  return root;
}

/// The matrix is symmetric, up to rounding, and positive definite.
bool is_covariance(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd size = matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
  if (!(size.array() > 0).all()) return false;
  const Eigen::VectorXd by = size.cwiseInverse();
  const Eigen::MatrixXd correlation = by.asDiagonal() * matrix * by.asDiagonal();
  return (correlation - correlation.transpose()).cwiseAbs().maxCoeff() < 1e-6 &&
         Eigen::LLT<Eigen::MatrixXd>(correlation).info() == Eigen::Success;
}

}  // namespace

std::string write_statistics(const Statistics& statistics) {
  std::string text =
      "# Statistics of one machine's runs, for thermocomp series: integrals over time.\n"
      "format = 1\nkind = \"statistics\"\n";
  add(text, "machine", toml_string(statistics.machine));
  add(text, "runs", toml_list(statistics.runs, toml_string));
  add(text, "time_s", toml_number(statistics.time_s));
  add_columns(text, statistics.columns);
  text += "xx = " + toml_rows(rows_of(statistics.xx));
  for (std::size_t o = 0; o < statistics.outputs.size(); ++o) {
    const auto at = static_cast<Eigen::Index>(o);
    text.append("\n[output.").append(toml_key(statistics.outputs[o])).append("]\n");
    add(text, "xy", toml_list(list_of(statistics.xy.col(at)), toml_number));
    add(text, "yy", toml_number(statistics.yy[at]));
    add(text, "noise_time_s", toml_number(statistics.noise_time_s[o]));
  }
  return text;
}

Statistics load_statistics(const std::filesystem::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  const TomlTable root = root_of(document, "statistics");
  Statistics statistics;
  statistics.machine = root.text("machine");
  statistics.runs = root.texts("runs");
  statistics.time_s = root.number("time_s", Range::above(0, value_max));
  statistics.columns = read_columns(root);
  const Eigen::Index count = statistics.columns.size();
  statistics.xx = matrix_of(root, "xx", count, count);
  const TomlTable outputs = root.table("output");
  const std::vector<std::string> names = outputs.keys();
  statistics.xy = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(names.size()));
  statistics.yy = Eigen::VectorXd::Zero(statistics.xy.cols());
  for (const std::string& name : names) {
    const auto at = static_cast<Eigen::Index>(statistics.outputs.size());
    if (!is_output(name)) outputs.problem(name, "must be a displacement (*_um) or a tilt (*_urad)");
    const TomlTable output = outputs.table(name);
    statistics.outputs.push_back(name);
    statistics.xy.col(at) = vector_of(output, "xy", count);
    statistics.yy[at] = output.number("yy", not_negative);
    statistics.noise_time_s.push_back(output.number("noise_time_s", Range::above(0, value_max)));
  }
  document.finish();
  return statistics;
}

std::string write_series(const Series& series) {
  std::string text =
      "# Mean coefficients of machines of one type and their scatter, for\n"
      "# thermocomp fit --prior and thermocomp inspect --series.\n"
      "format = 1\nkind = \"series\"\n";
  add(text, "machines", toml_list(series.machines, toml_string));
  if (!series.past_of.empty()) add(text, "past_of", toml_string(series.past_of));
  add(text, "hours", toml_number(series.hours));
  add_columns(text, series.columns);
  text += "# mean of the products of two columns\nmoment = " + toml_rows(rows_of(series.moment));
  for (const auto& [name, output] : series.outputs) {
    text.append("\n[output.").append(toml_key(name)).append("]\n");
    add(text, "displacement_um", toml_number(output.displacement_um));
    add(text, "remainder_um", toml_number(output.remainder_um));
    add(text, "noise_time_s", toml_number(output.noise_time_s));
    add(text, "remainders_um", toml_list(output.remainders_um, toml_number));
    add(text, "mean", toml_list(list_of(output.mean), toml_number));
    text += "covariance = " + toml_rows(rows_of(output.covariance));
  }
  return text;
}

Series load_series(const std::filesystem::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  const TomlTable root = root_of(document, "series");
  Series series;
  series.machines = root.texts("machines");
  series.past_of = root.text("past_of", "");
  series.hours = root.number("hours", not_negative);
  series.columns = read_columns(root);
  const Eigen::Index count = series.columns.size();
  series.moment = matrix_of(root, "moment", count, count);
  const TomlTable outputs = root.table("output");
  for (const std::string& name : outputs.keys()) {
    if (!is_output(name)) outputs.problem(name, "must be a displacement (*_um) or a tilt (*_urad)");
    const TomlTable table = outputs.table(name);
    OutputSeries& output = series.outputs[name];
    output.displacement_um = table.number("displacement_um", Range::above(0, value_max));
    output.remainder_um = table.number("remainder_um", Range::above(0, value_max));
    output.noise_time_s = table.number("noise_time_s", Range::above(0, value_max));
    output.remainders_um = table.numbers("remainders_um", not_negative);
    output.mean = vector_of(table, "mean", count);
    output.covariance = matrix_of(table, "covariance", count, count);
    if (table.has("covariance") && !is_covariance(output.covariance))
      table.problem("covariance", "...", "must be symmetric and positive definite");
  }
  document.finish();
  return series;
}

Series load_prior(const std::filesystem::path& file, double drift, double years) {
  const TomlDocument document = TomlDocument::from_file(file);
  if (document.root().has("kind")) return drifted(load_series(file), drift, std::max(years, 0.0));
  return series_of_model(load_model(file), file.string(), drift, years < 0 ? 1.0 : years);
}

}  // namespace thermocomp::series
