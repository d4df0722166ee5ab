/// Small line plots as SVG, for a page that needs nothing else.
#pragma once

#include <string>
#include <vector>

#include "modelling/diagnosis/measured_runs.hpp"

namespace thermocomp::diagnosis {

struct PlotLine {
  std::string label;
  std::string colour;
  const Column* values{nullptr};  ///< NaN leaves a gap
};

/// Lines over a common axis; long columns are thinned to what a screen shows.
[[nodiscard]] std::string line_plot(const std::string& title, const Column& time_s,
                                    const std::vector<PlotLine>& lines);
/// Dots of y over x.
[[nodiscard]] std::string scatter_plot(const std::string& title, const Column& x, const Column& y);

}  // namespace thermocomp::diagnosis
