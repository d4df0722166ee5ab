#include <algorithm>
#include <limits>
#include <map>

#include <nlohmann/json.hpp>

#include "cli/import/log_form.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/number_text.hpp"
#include "config/text/outer_json.hpp"
#include "config/text/problems.hpp"

namespace thermocomp::cli {
namespace {

using nlohmann::json;

[[noreturn]] void refuse(const std::string& name, const std::string& key, const std::string& value,
                         std::string rule) {
  throw ConfigurationError({Problem{name, 0, key, value, std::move(rule)}});
}

/// "temperature_sensor chamber" is called chamber, unless two would be called so.
std::map<std::string, std::string> short_names(const json& store) {
  std::map<std::string, std::string> names;
  const auto last_word = [](const std::string& full) {
    const std::size_t blank = full.rfind(' ');
    return blank == std::string::npos ? full : full.substr(blank + 1);
  };
  for (const auto& [full, object] : store.items()) {
    int same = 0;
    for (const auto& [other, ignored] : store.items())
      if (last_word(other) == last_word(full)) ++same;
    names[full] = plain_name(same == 1 ? last_word(full) : full);
  }
  return names;
}

struct Series {
  const char* key;
  const char* end;
  double factor;
  const char* said;
};
constexpr Series series[] = {{"temperatures", "_degC", 1.0, ""},
                             {"targets", "_target", 1.0, ", a signal: what the heater was set to"},
                             {"powers", "_power_percent", 100.0, ", times 100"},
                             {"speeds", "_speed_percent", 100.0, ", times 100"}};

void add_series(const std::string& name, const std::string& full, const std::string& plain,
                const json& object, RunFile& run) {
  for (const Series& one : series) {
    const auto found = object.find(one.key);
    if (found == object.end()) continue;
    const std::string key = full + "." + one.key;
    if (!found->is_array()) refuse(name, key, found->type_name(), "must be a list of numbers");
    std::vector<double> values;
    for (const json& value : *found) {
      if (!value.is_number() && !value.is_null())
        refuse(name, key, value.dump(), "must be a number or null");
      values.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN()
                                       : one.factor * value.get<double>());
    }
    if (values.size() != run.values[0].size() && run.columns.size() > 1)
      refuse(name, key, std::to_string(values.size()) + " values",
             "must be as many as the others have, " + std::to_string(run.values[0].size()));
    run.values[0].resize(values.size());
    run.columns.push_back(plain + one.end);
    run.values.push_back(std::move(values));
    run.understood.push_back("'" + full + "' " + one.key + " is " + run.columns.back() + one.said);
  }
}

}  // namespace

RunFile read_temperature_store(std::string_view text, const std::string& name,
                               const LogOptions& options) {
  json store;
  try {
    store = parse_outer_json(text);
  } catch (const JsonError& error) {
    refuse(name, "", "(no JSON)", error.what());
  }
  if (store.is_object() && store.contains("result")) store = store["result"];
  const bool is_store = store.is_object() && !store.empty() &&
                        std::any_of(store.begin(), store.end(), [](const json& object) {
                          return object.is_object() && object.contains("temperatures");
                        });
  if (!is_store)
    refuse(name, "", "(other JSON)",
           "must be the answer of Moonraker's server/temperature_store: a list \"temperatures\" "
           "for each heater and sensor");
  RunFile run;
  run.name = name;
  run.columns = {"time_s"};
  run.values.resize(1);
  const double period_s = options.period_s.value_or(1.0);
  run.understood.push_back("temperature store of Moonraker, a row each " + number_text(period_s) +
                           " s" + (options.period_s ? "" : " (its own period)") +
                           "; it has no time of day");
  const auto names = short_names(store);
  for (const auto& [full, object] : store.items())
    if (object.is_object()) add_series(name, full, names.at(full), object, run);
  for (std::size_t row = 0; row < run.values[0].size(); ++row)
    run.values[0][row] = static_cast<double>(row) * period_s;
  if (run.rows() == 0) refuse(name, "", "(empty)", "has no values");
  run.selected_end = run.rows();
  return run;
}

}  // namespace thermocomp::cli
