#include "modelling/diagnosis/hypothesis/parameter.hpp"

namespace thermocomp::diagnosis {

double shared_value(const std::vector<Parameter>& parameters, const std::string& name) {
  for (const Parameter& each : parameters)
    if (each.name == name) return each.values.at("");
  return 0.0;
}

Parameter gain_table(const FoundGains& found, Eigen::Index index) {
  Parameter parameter{found.names[static_cast<std::size_t>(index)], {}, {}};
  for (std::size_t output = 0; output < found.gains.size(); ++output) {
    if (found.gains[output].size() == 0) continue;
    const std::string& name = found.outputs[output];
    parameter.values[name] = found.gains[output][index];
    parameter.ci95[name] = found.ci95[output][static_cast<std::size_t>(index)];
  }
  return parameter;
}

std::size_t first_output(const FoundGains& found) {
  std::size_t output = 0;
  while (found.gains[output].size() == 0) ++output;
  return output;
}

std::vector<Parameter> gain_of_each_output(const FoundGains& found) {
  return {gain_table(found, 0)};
}

std::vector<Parameter> single_gain(const FoundGains& found) {
  const std::size_t output = first_output(found);
  return {
      {found.names.front(), {{"", found.gains[output][0]}}, {{"", found.ci95[output].front()}}}};
}

}  // namespace thermocomp::diagnosis
