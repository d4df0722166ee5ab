#include "config/model/model_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <openssl/evp.h>
#include <set>

#include <Eigen/Eigenvalues>

#include "config/model/model_tables.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using Rows = std::vector<std::vector<double>>;

constexpr std::size_t inputs_max = 512;
constexpr std::size_t outputs_max = 64;
/// Limits on the cost of a model: memory, time to build it, and time per cycle
/// (model_operations()).
constexpr std::size_t terms_max = 2000;
constexpr double operations_max = 1e6;
/// Tolerated rounding errors of a covariance in decimal form.
constexpr double covariance_tolerance = 1e-9;

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "" : ", ").append(name);
  return text;
}

/// @return whether it is a list of valid names (duplicates are a problem, but valid)
bool read_names(const TomlTable& root, std::string_view key, std::size_t count_max,
                bool (*right_unit)(std::string_view), std::string_view unit_rule,
                std::vector<std::string>& names) {
  names = root.texts(key);
  if (names.empty()) {
    if (root.has(key)) root.problem(key, "must name at least one column");
    return false;
  }
  if (names.size() > count_max) {
    root.problem(key, std::to_string(names.size()) + " names",
                 "must be at most " + std::to_string(count_max));
  }
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (name.empty()) continue;  // reported already
    if (!is_column_name(name)) root.problem(key, name, column_name_rule);
    if (!right_unit(name)) root.problem(key, name, unit_rule);
    if (!seen.insert(name).second) root.problem(key, name, "is named twice");
  }
  return !contains(names, "");
}

void read_reference(const TomlTable& root, ThermalModel& model) {
  if (root.is_text("reference")) {
    if (root.text("reference") != "first_sample") {
      root.problem("reference", "must be \"first_sample\" or a list of numbers, one per input");
    }
    return;
  }
  model.reference_degC = root.numbers("reference");
  const std::size_t count = model.reference_degC.size();
  if (root.has("reference") && count != model.inputs.size()) {
    root.problem("reference", std::to_string(count) + " values",
                 "must be \"first_sample\" or have one value per input (" +
                     std::to_string(model.inputs.size()) + ")");
  }
}

void read_guideway_rows(const TomlTable& table, const ThermalModel& model, GuidewaySpec& guideway) {
  const TomlTable rows = table.table("rows_um_per_K");
  const std::vector<std::string> outputs = rows.keys();
  if (rows && outputs.empty()) table.problem("rows_um_per_K", "must name at least one output");
  for (const std::string& output : outputs) {
    if (!contains(model.outputs, output)) {
      rows.problem(output, "must be one of the outputs: " + listed(model.outputs));
      continue;
    }
    guideway.rows_um_per_K[output] =
        rows.matrix(output, guideway.positions_mm.size(), model.inputs.size());
  }
}

GuidewaySpec read_guideway(const TomlTable& table, const std::string& name,
                           const ThermalModel& model) {
  GuidewaySpec guideway;
  guideway.name = name;
  guideway.axis = table.text("axis");
  if (!guideway.axis.empty() && kind_of(guideway.axis) != QuantityKind::position) {
    table.problem("axis", "must be a position, a column *_mm");
  }
  guideway.positions_mm = table.numbers("positions_mm");
  const std::vector<double>& at = guideway.positions_mm;
  if (table.has("positions_mm") && at.size() < 2) {
    table.problem("positions_mm", "must have at least two positions");
  }
  if (std::adjacent_find(at.begin(), at.end(), std::greater_equal<>()) != at.end()) {
    table.problem("positions_mm", "must be strictly increasing");
  }
  read_guideway_rows(table, model, guideway);
  return guideway;
}

void check_two_subjects(const TomlTable& table, TermSubject kind, const SubjectColumns& columns,
                        const ThermalModel& model) {
  const bool ordered = columns.first < columns.second;
  if (kind == TermSubject::two_model_temperatures &&
      !(ordered && contains(model.inputs, columns.first) &&
        contains(model.inputs, columns.second))) {
    table.problem("subject", "must be two of the inputs in lexical order, as \"a_degC|b_degC\": " +
                                 listed(model.inputs));
  }
  const auto position = [](const std::string& name) {
    return is_column_name(name) && kind_of(name) == QuantityKind::position;
  };
  const auto temperature = [](const std::string& name) {
    return is_column_name(name) && is_temperature(name);
  };
  if (kind == TermSubject::temperature_and_position &&
      !(ordered && ((position(columns.first) && temperature(columns.second)) ||
                    (temperature(columns.first) && position(columns.second))))) {
    table.problem("subject",
                  "must be a temperature and a position in lexical order, as \"a_degC|x_mm\"");
  }
}

/// Requires the acting column, then the temperature on which its effect depends.
void check_column_and_temperature(const TomlTable& table, const SubjectColumns& columns) {
  const auto temperature = [](const std::string& name) {
    return is_column_name(name) && is_temperature(name);
  };
  const std::string& acts = columns.first;
  if (!(temperature(acts) || (is_column_name(acts) && is_operating(acts))) ||
      !temperature(columns.second)) {
    table.problem("subject",
                  "must be a cause (a temperature or an operating signal) and the temperature that "
                  "its effect depends on, such as \"a_rpm|room_degC\"");
  }
}

void check_subject(const TomlTable& table, const TermKind& kind, const std::string& subject,
                   const ThermalModel& model) {
  if (subject.empty()) return;  // reported already
  if (kind.subject == TermSubject::two_model_temperatures ||
      kind.subject == TermSubject::temperature_and_position) {
    check_two_subjects(table, kind.subject, subject_columns(subject), model);
    return;
  }
  if (kind.subject == TermSubject::column_and_temperature) {
    check_column_and_temperature(table, subject_columns(subject));
    return;
  }
  const bool is_input = contains(model.inputs, subject);
  if (kind.subject == TermSubject::model_temperature && !is_input) {
    table.problem("subject", "must be one of the inputs: " + listed(model.inputs));
  }
  if (kind.subject == TermSubject::output && !contains(model.outputs, subject)) {
    table.problem("subject", "must be one of the outputs: " + listed(model.outputs));
  }
  if (kind.subject == TermSubject::other_temperature && (is_input || !is_temperature(subject))) {
    table.problem("subject", "must be a temperature (*_degC, *_K) that is not among the inputs");
  }
  if (kind.subject == TermSubject::any_temperature && !is_temperature(subject)) {
    table.problem("subject", "must be a temperature (*_degC, *_K)");
  }
  if (kind.subject == TermSubject::signal && (is_input || !is_operating(subject))) {
    table.problem("subject", "must be an operating signal or a position, not a temperature");
  }
  if (!is_column_name(subject)) table.problem("subject", column_name_rule);
}

void read_parameter(const TomlTable& table, const TermParameter& parameter,
                    const ThermalModel& model, TermSpec& term) {
  const Range range = Range::between(parameter.min, parameter.max);
  if (!parameter.per_output) {
    if (parameter.whole_number) {
      const auto low = static_cast<std::int64_t>(parameter.min);
      const auto high = static_cast<std::int64_t>(parameter.max);
      term.shared[parameter.name] = static_cast<double>(table.integer(parameter.name, low, high));
    } else {
      term.shared[parameter.name] = table.number(parameter.name, range);
    }
    return;
  }
  const TomlTable outputs = table.table(parameter.name);
  const std::vector<std::string> named = outputs.keys();
  if (outputs && named.empty()) table.problem(parameter.name, "must name at least one output");
  for (const std::string& output : named) {
    if (!contains(model.outputs, output)) {
      outputs.problem(output, "must be one of the outputs: " + listed(model.outputs));
      continue;
    }
    term.per_output[parameter.name][output] = outputs.number(output, range);
  }
}

void read_bank_subjects(const TomlTable& table, LagBankSpec& bank) {
  bank.subjects = table.texts("subjects");
  if (bank.subjects.empty() && table.has("subjects")) {
    table.problem("subjects", "must name at least one column");
  }
  if (bank.subjects.size() > bank_subjects_max) {
    table.problem("subjects", std::to_string(bank.subjects.size()) + " names",
                  "must be at most " + std::to_string(bank_subjects_max));
  }
  for (const std::string& name : bank.subjects) {
    if (name.empty()) continue;  // reported already
    if (!is_column_name(name)) table.problem("subjects", name, column_name_rule);
    if (!is_temperature(name) && !is_operating(name)) {
      table.problem("subjects", name, "must be a temperature, an operating signal or a position");
    }
  }
  bank.powers = table.numbers("powers", Range::between(1, 2), {});
  if (table.has("powers") && bank.powers.size() != bank.subjects.size()) {
    table.problem("powers", std::to_string(bank.powers.size()) + " values",
                  "must have one value per subject (" + std::to_string(bank.subjects.size()) + ")");
  }
  std::set<std::pair<std::string, double>> seen;
  for (std::size_t i = 0; i < bank.subjects.size(); ++i) {
    const double power = i < bank.powers.size() ? bank.powers[i] : 1.0;
    if (power != 1.0 && power != 2.0) table.problem("powers", "must be 1 or 2 each");
    if (!seen.insert({bank.subjects[i], power}).second) {
      table.problem("subjects", bank.subjects[i], "is named twice with the same power");
    }
  }
}

void read_bank_taus(const TomlTable& table, LagBankSpec& bank) {
  bank.taus_s = table.numbers("tau_s", Range::between(0, term_tau_s_max));
  if (bank.taus_s.empty() && table.has("tau_s")) {
    table.problem("tau_s", "must have at least one time constant");
  }
  if (bank.taus_s.size() > bank_taus_max) {
    table.problem("tau_s", std::to_string(bank.taus_s.size()) + " values",
                  "must be at most " + std::to_string(bank_taus_max));
  }
  if (std::adjacent_find(bank.taus_s.begin(), bank.taus_s.end(), std::greater_equal<>()) !=
      bank.taus_s.end()) {
    table.problem("tau_s", "must be strictly increasing");
  }
}

void read_bank_gains(const TomlTable& table, const ThermalModel& model, LagBankSpec& bank) {
  const TomlTable gains = table.table("gain_um_per_unit");
  const std::vector<std::string> named = gains.keys();
  if (gains && named.empty()) table.problem("gain_um_per_unit", "must name at least one output");
  for (const std::string& output : named) {
    if (!contains(model.outputs, output)) {
      gains.problem(output, "must be one of the outputs: " + listed(model.outputs));
      continue;
    }
    const Rows rows = gains.matrix(output, bank.subjects.size(), bank.taus_s.size());
    for (const std::vector<double>& row : rows) {
      for (const double gain : row) {
        if (!(std::abs(gain) <= term_gain_max)) gains.problem(output, "must be in [-1e6, 1e6]");
      }
    }
    bank.gain_um_per_unit[output] = rows;
  }
}

TermSpec read_bank(const TomlTable& table, const ThermalModel& model) {
  TermSpec term;
  term.kind = table.text("kind");
  read_bank_subjects(table, term.bank);
  read_bank_taus(table, term.bank);
  if (term.bank.subjects.empty() || term.bank.taus_s.empty()) {
    table.ignore_rest();  // shapes cannot be checked
    return term;
  }
  read_bank_gains(table, model, term.bank);
  return term;
}

TermSpec read_term(const TomlTable& table, const ThermalModel& model) {
  TermSpec term;
  term.kind = table.text("kind");
  if (const TermKind* named = find_term_kind(term.kind, ""); named != nullptr && named->is_bank())
    return read_bank(table, model);
  term.subject = table.text("subject");
  const TermKind* kind = find_term_kind(term.kind, term.subject);
  if (kind == nullptr) {
    std::vector<std::string> names;
    for (const TermKind& known : term_kinds()) {
      if (!contains(names, known.name)) names.push_back(known.name);
    }
    if (!term.kind.empty()) table.problem("kind", "must be one of: " + listed(names));
    table.ignore_rest();
    return term;
  }
  check_subject(table, *kind, term.subject, model);
  for (const TermParameter& parameter : kind->parameters) {
    read_parameter(table, parameter, model, term);
  }
  return term;
}

void check_covariance(const TomlTable& table, const Rows& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd matrix(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  const double largest = matrix.cwiseAbs().maxCoeff();
  if (!((matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= covariance_tolerance * largest)) {
    table.problem("matrix_K2", "must be symmetric");
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix, Eigen::EigenvaluesOnly);
  const double smallest = solver.eigenvalues().minCoeff();
  if (!(smallest >= -covariance_tolerance * largest * static_cast<double>(n))) {
    table.problem("matrix_K2", "must be positive semidefinite");
  }
}

std::vector<double> read_factors(const TomlTable& table, std::string_view key, std::size_t inputs) {
  std::vector<double> factors = table.numbers(key, Range::between(0, 1e6), {});
  if (table.has(key) && factors.size() != inputs) {
    table.problem(key, std::to_string(factors.size()) + " values",
                  "must have one value per input (" + std::to_string(inputs) + ")");
  }
  return factors;
}

void read_covariance(const TomlTable& root, ThermalModel& model) {
  if (!root.has("covariance")) return;
  const TomlTable table = root.table("covariance");
  model.covariance_K2 = table.matrix("matrix_K2", model.inputs.size(), model.inputs.size());
  if (!model.covariance_K2.empty()) check_covariance(table, model.covariance_K2);
  if (model.inputs.size() > covariance_inputs_max) {
    table.problem("matrix_K2", std::to_string(model.inputs.size()) + " inputs",
                  "must be for at most " + std::to_string(covariance_inputs_max) + " inputs");
  }
  CovarianceGrowth& growth = model.covariance_growth;
  growth.noise_K = table.number("noise_K", Range::above(0, 10), growth.noise_K);
  growth.drift_time_s = table.number("drift_time_s", Range::between(0, 1e9), growth.drift_time_s);
  growth.scatter_time_s =
      table.number("scatter_time_s", Range::between(0, 1e9), growth.scatter_time_s);
  growth.drift_factor = read_factors(table, "drift_factor", model.inputs.size());
  growth.scatter_factor = read_factors(table, "scatter_factor", model.inputs.size());
}

std::vector<DiameterSpec> read_diameters(const TomlTable& root, const ThermalModel& model) {
  std::vector<DiameterSpec> diameters;
  for (const TomlTable& table : root.tables("diameter")) {
    DiameterSpec diameter{table.text("output"), table.text("axis"), 1.0};
    const auto named = [&](const DiameterSpec& other) { return other.output == diameter.output; };
    if (std::find(model.outputs.begin(), model.outputs.end(), diameter.output) ==
        model.outputs.end())
      table.problem("output", diameter.output, "must be an output of the model");
    else if (!diameter.output.ends_with("_um"))
      table.problem("output", diameter.output, "must be a length (*_um)");
    else if (std::any_of(diameters.begin(), diameters.end(), named))
      table.problem("output", diameter.output, "is a diameter already");
    diameter.sign = table.choice<double>("sign", {{"+", 1.0}, {"-", -1.0}}, diameter.sign);
    diameters.push_back(std::move(diameter));
  }
  return diameters;
}

void check_cost(const TomlTable& root, const ThermalModel& model) {
  if (model.terms.size() > terms_max)
    root.problem("term", std::to_string(model.terms.size()) + " terms",
                 "must be at most " + std::to_string(terms_max));
  const double operations = model_operations(model);
  if (!(operations <= operations_max))
    root.problem("term", std::to_string(std::llround(operations)) + " multiplications a step",
                 "matrix, guideways and terms together must take at most " +
                     std::to_string(std::llround(operations_max)) +
                     " (lag_bank: subjects x time constants x outputs)");
}

/// @return whether the names could be read
bool read_model(const TomlDocument& document, ThermalModel& model) {
  const TomlTable root = document.root();
  static_cast<void>(root.integer("format", 1, 1));
  const bool inputs_known = read_names(root, "inputs", inputs_max, is_temperature,
                                       "must be a temperature (*_degC, *_K)", model.inputs);
  const bool outputs_known =
      read_names(root, "outputs", outputs_max, is_output,
                 "must be a displacement (*_um) or a tilt (*_urad)", model.outputs);
  if (!inputs_known || !outputs_known) {
    root.ignore_rest();  // shapes cannot be checked
    return false;
  }
  read_reference(root, model);
  model.matrix_um_per_K = root.matrix("matrix_um_per_K", model.outputs.size(), model.inputs.size());
  const TomlTable guideways = root.table_or_empty("guideway");
  for (const std::string& name : guideways.keys()) {
    model.guideways.push_back(read_guideway(guideways.table(name), name, model));
  }
  for (const TomlTable& term : root.tables("term")) {
    model.terms.push_back(read_term(term, model));
  }
  check_cost(root, model);
  read_covariance(root, model);
  if (root.has("made_from")) model.made_from = read_made_from(root.table("made_from"), model);
  model.diameters = read_diameters(root, model);
  if (root.has("course")) model.course = read_course(root.table("course"), model);
  return true;
}

}  // namespace

double model_operations(const ThermalModel& model) {
  const auto count = [](const auto& list) { return static_cast<double>(list.size()); };
  constexpr double operations_a_term = 20.0;
  double operations = count(model.inputs) * count(model.outputs);
  for (const GuidewaySpec& guideway : model.guideways)
    operations += 2.0 * count(model.inputs) * count(guideway.rows_um_per_K);
  for (const TermSpec& term : model.terms)
    operations += operations_a_term + count(model.outputs) +
                  count(term.bank.subjects) * count(term.bank.taus_s) *
                      (1.0 + count(term.bank.gain_um_per_unit));
  return operations;
}

ModelReading read_model_text(const std::string& text, const std::string& name) {
  ModelReading reading;
  try {
    const TomlDocument document = TomlDocument::from_text(text, name);
    reading.names_known = read_model(document, reading.model);
    reading.problems = document.all_problems();
  } catch (const ConfigurationError& error) {  // not TOML
    reading.problems = error.problems();
  }
  return reading;
}

ThermalModel parse_model(const std::string& text, const std::string& name) {
  ModelReading reading = read_model_text(text, name);
  if (!reading.problems.empty()) throw ConfigurationError(std::move(reading.problems));
  return std::move(reading.model);
}

ThermalModel load_model(const std::filesystem::path& path) {
  return parse_model(read_text_file(path, model_bytes_max), path.string());
}

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  const int done =
      EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  THERMOCOMP_ENSURE(done == 1 && size == 32);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    constexpr std::string_view digits = "0123456789abcdef";
    text += digits[digest[i] >> 4u];
    text += digits[digest[i] & 15u];
  }
  return text;
}

}  // namespace thermocomp
