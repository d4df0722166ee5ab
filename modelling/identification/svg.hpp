/// Plain SVG pictures: curves over a common axis, and an ordered heat map.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace thermocomp::identification {

struct Curve {
  std::string name;
  std::vector<double> x;
  std::vector<double> y;  ///< NaN: a gap
  std::string colour;     ///< empty: the next of a fixed list
  bool dashed{false};
};

struct Diagram {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<Curve> curves;
  double width_px{720.0};
  double height_px{300.0};
};

/// An <svg> element; courses of more than some thousand points are thinned out.
[[nodiscard]] std::string svg_of(const Diagram& diagram);

/// Squares from light (0) to dark (1) on a logarithmic scale, rows and columns in `order`, with a
/// frame around each run of `group_sizes`.
struct HeatMap {
  std::string title;
  std::vector<std::string> names;
  Eigen::MatrixXd values;
  std::vector<std::size_t> order;
  std::vector<std::size_t> group_sizes;
};
[[nodiscard]] std::string svg_of(const HeatMap& map);

}  // namespace thermocomp::identification
