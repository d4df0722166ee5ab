#include "config/model/made_from.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "config/toml/toml_text.hpp"
#include "estimator/model/model_domain.hpp"

namespace thermocomp {
namespace {

constexpr double rows_max = 1e12;
constexpr double spread_min = 1e-9;
constexpr double pivot_share_min = 1e-7;
constexpr double value_max = 1e12;  ///< of a figure: keeps squares finite

/// The figures of an output, each under its key.
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

/// @return whether the shapes that stand on them can be judged
bool read_columns(const TomlTable& table, const ThermalModel& model, MadeFrom& made_from) {
  made_from.columns = table.texts("columns");
  std::vector<std::string> read = model.temperature_columns();
  const std::vector<std::string> signals = model.signal_columns();
  read.insert(read.end(), signals.begin(), signals.end());
  std::set<std::string> seen;
  bool known = !made_from.columns.empty();
  for (const std::string& name : made_from.columns) {
    if (name.empty()) continue;  // a problem already
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
  made_from.low = numbers_for(table, "low", made_from.columns.size(), "a column");
  made_from.high = numbers_for(table, "high", made_from.columns.size(), "a column");
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
  // Pivots, each beside its own spread: what squares of the inverse stand on.
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
  made_from.mean = numbers_for(table, "mean", count, "a feature");
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
