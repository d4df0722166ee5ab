#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

#include <utility>

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

std::size_t free_parameters(const Hypothesis& hypothesis) {
  const auto of_shape = std::count_if(hypothesis.shape.begin(), hypothesis.shape.end(),
                                      [](const ShapeParameter& each) { return !each.discrete; });
  return static_cast<std::size_t>(of_shape) + hypothesis.gains.size();
}

Shapes grid_of(const Hypothesis& hypothesis) {
  std::size_t points = 1;
  for (const ShapeParameter& parameter : hypothesis.shape) points *= parameter.grid.size();
  Shapes all;
  all.reserve(points);
  for (std::size_t number = 0; number < points; ++number) {
    Shape point(hypothesis.shape.size());
    std::size_t index = number;
    for (std::size_t i = point.size(); i-- > 0;) {
      const std::vector<double>& grid = hypothesis.shape[i].grid;
      point[i] = grid[index % grid.size()];
      index /= grid.size();
    }
    all.push_back(std::move(point));
  }
  return all;
}

std::vector<double> firsts_of(const Shapes& shapes) {
  std::vector<double> firsts;
  firsts.reserve(shapes.size());
  for (const Shape& shape : shapes) firsts.push_back(shape[0]);
  return firsts;
}

}  // namespace thermocomp::diagnosis
