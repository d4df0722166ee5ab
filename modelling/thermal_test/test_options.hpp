/// Which test, and what a person says about its record.
#pragma once

#include <string>
#include <vector>

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

}  // namespace thermocomp::thermal_test
