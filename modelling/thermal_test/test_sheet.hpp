/// Plan of a test as a sheet: instructions, and a row for each reading.
#pragma once

#include <string>
#include <vector>

#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

struct SheetOptions {
  TestKind kind{TestKind::spindle};
  double hours{4.0};          ///< of running, or of a whole test of the environment
  double cooling_h{2.0};      ///< after running
  double every_min{5.0};      ///< interval of readings
  double rpm_max{0.0};        ///< spindle; 0: not given
  bool steps{false};          ///< stepped speeds instead of one
  double feed_mm_per_min{0};  ///< axis; 0: not given
  char moving{'x'};           ///< the axis that moves
};

struct SheetStep {
  double from_min{0.0};
  double to_min{0.0};
  double speed{0.0};  ///< spindle speed, or feed of the axis
};

/// Schedule: a quarter of an hour of rest, running, cooling.
/// @throws ConfigurationError naming the option
[[nodiscard]] std::vector<SheetStep> sheet_steps(const SheetOptions& options);

/// A blank run file for `thermal-test report`.
[[nodiscard]] std::string sheet_csv(const SheetOptions& options);
/// Likewise for paper.
[[nodiscard]] std::string sheet_html(const SheetOptions& options);

}  // namespace thermocomp::thermal_test
