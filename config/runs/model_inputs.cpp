#include "config/runs/model_inputs.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "config/text/problems.hpp"

namespace thermocomp {
namespace {

using Columns = std::vector<const std::vector<double>*>;

Columns columns_of(const RunFile& run, const std::vector<std::string>& names,
                   std::vector<Problem>& problems) {
  Columns columns;
  for (const std::string& name : names) {
    const auto index = run.find(name);
    if (index)
      columns.push_back(&run.values[*index]);
    else
      problems.push_back({run.name, 0, name, "(missing)",
                          "the model needs this column (--columns gives one another name)"});
  }
  return columns;
}

std::vector<double> references(const ThermalModel& model, const RunFile& run,
                               const Columns& temperatures, const std::vector<std::string>& names) {
  std::vector<Problem> problems;
  std::vector<double> result;
  for (std::size_t i = 0; i < temperatures.size(); ++i) {
    if (i < model.reference_degC.size()) {
      result.push_back(model.reference_degC[i]);
      continue;
    }
    const std::optional<double> first = first_value(*temperatures[i]);
    if (first)
      result.push_back(*first);
    else
      problems.push_back({run.name, 0, names[i], "(missing)", "has no value to refer to"});
  }
  if (!problems.empty()) throw ConfigurationError(problems);
  return result;
}

std::vector<std::size_t> whole_rows(std::size_t count, const ModelInputs& inputs) {
  std::vector<char> whole(count, 1);
  for (const Columns* columns : {&inputs.temperatures, &inputs.signals})
    for (const std::vector<double>* column : *columns)
      for (std::size_t row = 0; row < count; ++row)
        whole[row] =
            static_cast<char>(whole[row] & static_cast<char>(std::isfinite((*column)[row])));
  std::vector<std::size_t> rows;
  rows.reserve(count);
  for (std::size_t row = 0; row < count; ++row)
    if (whole[row] != 0) rows.push_back(row);
  return rows;
}

}  // namespace

ModelInputs model_inputs(const ThermalModel& model, const RunFile& run) {
  std::vector<Problem> problems;
  const std::vector<std::string> names = model.temperature_columns();
  ModelInputs inputs;
  inputs.temperatures = columns_of(run, names, problems);
  inputs.signals = columns_of(run, model.signal_columns(), problems);
  if (!problems.empty()) throw ConfigurationError(problems);
  inputs.reference_degC = references(model, run, inputs.temperatures, names);
  inputs.rows = whole_rows(run.rows(), inputs);
  return inputs;
}

std::optional<double> first_value(const std::vector<double>& column) {
  const auto first =
      std::find_if(column.begin(), column.end(), [](double value) { return std::isfinite(value); });
  return first == column.end() ? std::nullopt : std::optional(*first);
}

nanoseconds time_of_row(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

bool is_called_like_a_room(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto is_letter = [&](std::size_t i) {
    return std::isalpha(static_cast<unsigned char>(name[i])) != 0;
  };
  for (const std::string_view word : {"room", "ambient", "air", "raum", "luft", "umgebung", "hall"})
    for (std::size_t at = name.find(word); at != std::string::npos; at = name.find(word, at + 1))
      if (at == 0 || !is_letter(at - 1)) return true;  // not "pair", "shallow"
  return false;
}

}  // namespace thermocomp
