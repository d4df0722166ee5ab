#include "modelling/diagnosis/thermal/corrected_machine.hpp"

#include <algorithm>
#include <functional>
#include <sstream>

#include <toml++/toml.h>

#include "estimator/checks.hpp"

namespace thermocomp::diagnosis {
namespace {

double value_of(const NamedFinding& finding, const std::string& name) {
  for (const Parameter& parameter : finding.parameters)
    if (parameter.name == name) return parameter.values.at("");
  THERMOCOMP_ENSURE(false);
  return 0.0;
}

/// SIGNAL|NODE, NODE|NODE, NODE|room: what stands before and behind the bar.
struct Subject {
  std::string first;
  std::string second;
};

Subject subject_of(const NamedFinding& finding) {
  const std::size_t bar = finding.subject.find('|');
  if (bar == std::string::npos) return {finding.subject, ""};
  return {finding.subject.substr(0, bar), finding.subject.substr(bar + 1)};
}

bool says(const toml::table& table, const char* key, const std::string& value) {
  return table[key].value<std::string>() == value;
}

/// The first of the root's tables of a kind that a condition holds for.
toml::table* entry(toml::table& root, const char* kind,
                   const std::function<bool(const toml::table&)>& is) {
  toml::array* const all = root[kind].as_array();
  for (std::size_t i = 0; all != nullptr && i < all->size(); ++i)
    if (toml::table* const table = all->get(i)->as_table(); table != nullptr && is(*table))
      return table;
  return nullptr;
}

toml::table* named(toml::table& root, const char* kind, const std::string& name) {
  return entry(root, kind, [&](const toml::table& table) { return says(table, "name", name); });
}

bool multiply(toml::table* table, const char* key, double factor) {
  if (table == nullptr) return false;
  table->insert_or_assign(key, factor * (*table)[key].value_or(0.0));
  return true;
}

void append(toml::table& root, const char* kind, const toml::table& table) {
  if (root[kind].as_array() == nullptr) root.insert_or_assign(kind, toml::array{});
  root[kind].as_array()->push_back(table);
}

void add_source(toml::table& root, const Subject& subject, const NamedFinding& finding) {
  append(root, "source",
         toml::table{{"node", subject.second},
                     {"signal", subject.first},
                     {"heat_W", value_of(finding, "heat_W")},
                     {"at", value_of(finding, "at")},
                     {"exponent", value_of(finding, "power")}});
  if (named(root, "signal", subject.first) == nullptr)
    append(root, "signal",
           toml::table{{"name", subject.first},
                       {"kind", "steps"},
                       {"times_s", toml::array{0.0}},
                       {"values", toml::array{0.0}}});
}

bool joins(const toml::table& link, const Subject& subject) {
  const toml::array* const ends = link["between"].as_array();
  if (ends == nullptr || ends->size() != 2) return false;
  const auto first = ends->get(0)->value_or(std::string());
  const auto second = ends->get(1)->value_or(std::string());
  return std::min(first, second) == subject.first && std::max(first, second) == subject.second;
}

/// @return whether a key of the file carries the finding
bool carry(toml::table& root, const NamedFinding& finding) {
  const Subject subject = subject_of(finding);
  const auto factor = [&finding] { return value_of(finding, "factor"); };
  if (finding.cause == "wrong_film_coefficient")
    return multiply(named(root, "node", subject.first),
                    subject.second == "room" ? "room_W_per_K" : "coolant_W_per_K", factor());
  if (finding.cause == "wrong_heat_capacity")
    return multiply(named(root, "node", subject.first), "capacity_J_per_K", factor());
  if (finding.cause == "wrong_conductance")
    return multiply(
        entry(root, "link", [&](const toml::table& table) { return joins(table, subject); }),
        "conductance_W_per_K", factor());
  if (finding.cause == "wrong_heat_source") {
    const auto is = [&](const toml::table& table) {
      return says(table, "signal", subject.first) && says(table, "node", subject.second);
    };
    return multiply(entry(root, "source", is), "heat_W", factor());
  }
  if (finding.cause == "missing_heat_source") {
    add_source(root, subject, finding);
    return true;
  }
  if (finding.cause != "slow_sensor") return false;
  const std::string name = subject.first.substr(0, subject.first.rfind("_degC"));
  toml::table* const thermocouple = named(root, "thermocouple", name);
  if (thermocouple == nullptr) return false;
  thermocouple->insert_or_assign(
      "lag_s", (*thermocouple)["lag_s"].value_or(0.0) + value_of(finding, "tau_s"));
  return true;
}

}  // namespace

std::optional<std::string> corrected_machine(const std::filesystem::path& path,
                                             const std::vector<NamedFinding>& findings) {
  toml::table root = toml::parse_file(path.string());
  if (root["plant"]["body"].value_or(std::string()) != "") return std::nullopt;
  std::ostringstream text;
  text << "# Written by thermocomp diagnose: values as the training runs have them.\n";
  for (const NamedFinding& finding : findings)
    if (!carry(root, finding))
      text << "# No key carries " << finding.cause << " of " << finding.subject << ".\n";
  text << root << '\n';
  return text.str();
}

}  // namespace thermocomp::diagnosis
