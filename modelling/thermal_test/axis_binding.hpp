/// Which columns of a record are the displacements of which axis.
#pragma once

#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/thermal_test/test_options.hpp"

namespace thermocomp::thermal_test {

/// A displacement, or a tilt: the difference of two divided by their distance.
struct AxisBinding {
  std::string axis;  ///< "x", "b", "x2"
  std::string column;
  std::string less;         ///< the second probe; empty: none
  double distance_mm{0.0};  ///< between the two
};

/// What `--axis` says and, without it, what the names of the columns say.
/// @throws ConfigurationError naming what was written and what is required
[[nodiscard]] std::vector<AxisBinding> bind_axes(const RunFile& run, const TestOptions& options);

/// "X", "X at position 2"
[[nodiscard]] std::string axis_words(const std::string& axis);

}  // namespace thermocomp::thermal_test
