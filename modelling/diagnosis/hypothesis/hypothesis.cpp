#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

Shapes grid_of(const Hypothesis& hypothesis) {
  std::size_t points = 1;
  for (const ShapeParameter& parameter : hypothesis.shape) points *= parameter.grid.size();
  Shapes all;
  all.reserve(points);
  for (std::size_t i = 0; i < points; ++i) all.push_back(point_of_grid(hypothesis, i));
  return all;
}

Shape point_of_grid(const Hypothesis& hypothesis, std::size_t index) {
  Shape point(hypothesis.shape.size());
  for (std::size_t i = point.size(); i-- > 0;) {
    const std::vector<double>& grid = hypothesis.shape[i].grid;
    point[i] = grid[index % grid.size()];
    index /= grid.size();
  }
  return point;
}

std::vector<double> firsts_of(const Shapes& shapes) {
  std::vector<double> firsts;
  firsts.reserve(shapes.size());
  for (const Shape& shape : shapes) firsts.push_back(shape[0]);
  return firsts;
}

}  // namespace thermocomp::diagnosis
