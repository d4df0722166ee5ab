#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

using Names = std::set<std::string>;

/// What a name of a parameter in this unit ends with: "um/(K mm)" is um_per_K_mm.
std::string suffix_of(std::string_view unit) {
  std::string suffix;
  for (const char each : unit) {
    if (each == '/')
      suffix += "_per_";
    else if (each == '?')
      suffix += "unit";
    else if (each == ' ')
      suffix += '_';
    else if (each != '(' && each != ')' && each != '^')
      suffix += each;
  }
  return suffix;
}

/// The words between backticks.
Names in_backquotes(const std::string& text) {
  Names names;
  std::size_t begin = 0;
  while ((begin = text.find('`', begin)) != std::string::npos) {
    const std::size_t end = text.find('`', begin + 1);
    if (end == std::string::npos) break;
    names.insert(text.substr(begin + 1, end - begin - 1));
    begin = end + 1;
  }
  return names;
}

/// The parameters that docs/diagnosis.md gives to each cause, in all of its tables of causes.
std::map<std::string, Names> documented() {
  std::ifstream file(THERMOCOMP_DIAGNOSIS_TEXT);
  REQUIRE(file.good());
  std::map<std::string, Names> causes;
  bool in_table = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("| cause | subject | parameters |", 0) == 0) in_table = true;
    if (line.empty() || line.front() != '|') in_table = false;
    if (!in_table) continue;
    for (std::size_t at = 0; (at = line.find("\\|", at)) != std::string::npos;)
      line.erase(at, 2);  // within a cell
    std::vector<std::string> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, '|');) cells.push_back(cell);
    REQUIRE(cells.size() >= 4);
    for (const std::string& cause : in_backquotes(cells[1].substr(0, cells[1].find(':')))) {
      Names parameters = in_backquotes(cells[3]);
      parameters.erase("run");  // of the finding, not of the cause
      causes[cause].merge(parameters);
    }
  }
  return causes;
}

/// A machine with everything that a cause of the displacement can act on.
RunFile machine_run(int rows, double start_degC = 20.0) {
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "t1_degC", "t2_degC", "room_degC", "spindle_rpm", "x_mm", "z_um"};
  run.values.resize(run.columns.size());
  for (int row = 0; row < rows; ++row) {
    const double rise_K = 5.0 * std::sin(row / 60.0);
    const std::vector<double> values = {60.0 * row,
                                        start_degC + rise_K,
                                        21.0 + 3.0 * std::sin(row / 23.0),
                                        start_degC + std::sin(row / 200.0),
                                        row / 50 % 2 == 0 ? 0.0 : 3000.0,
                                        100.0 * std::sin(row / 7.0),
                                        5.0 * rise_K};
    for (std::size_t i = 0; i < values.size(); ++i) run.values[i].push_back(values[i]);
  }
  run.selected_end = run.rows();
  return run;
}

}  // namespace

TEST_CASE("every cause is complete and unique", "[diagnosis][causes]") {
  const Names families = {"structure", "heat", "datum", "sensor"};
  Names names;
  for (const Cause& cause : all_causes()) {
    INFO(cause.name);
    CHECK(names.insert(cause.name).second);
    CHECK(&cause_named(cause.name) == &cause);
    CHECK(families.contains(cause.family));
    CHECK((cause.hypotheses != nullptr || cause.in_network != nullptr));
    CHECK_FALSE(cause.texts.title.empty());
    CHECK_FALSE(cause.texts.description.empty());
    REQUIRE_FALSE(cause.texts.to_do.empty());
    CHECK(cause.texts.to_do.back() == '.');
    Names parameters;
    for (const CauseParameter& parameter : cause.parameters) {
      INFO(parameter.name);
      CHECK(parameters.insert(std::string(parameter.name)).second);
      CHECK_FALSE(parameter.description.empty());
      REQUIRE_FALSE(parameter.unit.empty());
      CHECK(parameter.low < parameter.high);
      if (parameter.unit != "1") CHECK(parameter.name.ends_with(suffix_of(parameter.unit)));
    }
  }
}

TEST_CASE("a cause becomes the term of its name, where the daemon evaluates one",
          "[diagnosis][causes]") {
  for (const Cause& cause : all_causes()) {
    INFO(cause.name);
    bool known = false;
    for (const TermKind& kind : term_kinds()) {
      if (kind.name != cause.name) continue;
      known = true;
      for (const TermParameter& parameter : kind.parameters) {
        INFO(parameter.name);
        const CauseParameter* const of = find_parameter(cause, parameter.name);
        REQUIRE(of != nullptr);
        if (std::isfinite(of->low)) CHECK(of->low >= parameter.min);
        if (std::isfinite(of->high)) CHECK(of->high <= parameter.max);
      }
    }
    if (cause.correction != nullptr) CHECK_FALSE(known);
  }
}

TEST_CASE("causes and their parameters are those of the documentation", "[diagnosis][causes]") {
  std::map<std::string, Names> expected = documented();
  for (const Cause& cause : all_causes()) {
    INFO(cause.name);
    Names parameters;
    for (const CauseParameter& each : cause.parameters) parameters.emplace(each.name);
    const auto row = expected.extract(cause.name);
    REQUIRE_FALSE(row.empty());
    CHECK(row.mapped() == parameters);
  }
  for (const auto& [cause, parameters] : expected) FAIL_CHECK(cause << " is no cause");
}

TEST_CASE("shape grids lie within the physical range of their parameters", "[diagnosis][causes]") {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0, 1.0}};
  const std::vector<RunFile> runs = {machine_run(900), machine_run(900, 18.0),
                                     machine_run(900, 23.0)};
  const MeasuredData data = measured_data(model, runs, shared_columns(model, runs));
  Names tried;
  for (const Hypothesis& each : hypotheses(data)) {
    const Cause& cause = cause_named(each.cause);
    INFO(each.cause << " of " << each.subject);
    tried.insert(cause.name);
    CHECK(each.columns({grid_of(each).front()}, 0).allFinite());
    if (cause.gains != nullptr) CHECK_FALSE(each.gains.empty());
    CHECK(static_cast<bool>(each.errors_K) == each.sensor.has_value());
    for (const ShapeParameter& shape : each.shape) {
      INFO(shape.name);
      const CauseParameter* const of = find_parameter(cause, shape.name);
      REQUIRE(of != nullptr);
      REQUIRE_FALSE(shape.grid.empty());
      CHECK(std::is_sorted(shape.grid.begin(), shape.grid.end()));  // what is refined looks so
      CHECK(shape.grid.front() >= of->low);
      CHECK(shape.grid.back() <= of->high * (1 + 1e-12));
    }
  }
  for (const Cause& cause : all_causes())
    CHECK(tried.contains(cause.name) == (cause.hypotheses != nullptr));
}
