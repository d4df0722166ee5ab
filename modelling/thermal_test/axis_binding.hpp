/// What a person says about the record of a test, and which columns are the displacements of which
/// axis.
#pragma once

#include <string>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp::thermal_test {

enum class TestKind { environment, spindle, axis };
[[nodiscard]] std::string to_string(TestKind kind);

/// What a person says about the columns of a record; empty: by their names.
struct TestOptions {
  TestKind kind{TestKind::spindle};
  std::vector<std::string> axes;  ///< "z=ch5_um", "a=ch3_um-ch4_um/150mm"
  std::string running;            ///< column that is not 0 while it runs, or "T0:T1" in seconds
  std::string room;               ///< column of the room's temperature
  double distance_mm{0.0};        ///< between the probes x1 and x2, y1 and y2; 0: not known
  double noise_um{-1.0};          ///< standard deviation of a value; below 0: from the values
};

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
