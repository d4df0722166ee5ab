/// A plan of a test as a sheet: what to do, and a row for each reading.
#pragma once

#include <string>
#include <vector>

#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

struct SheetOptions {
  TestKind kind{TestKind::spindle};
  double hours{4.0};          ///< of running, or of the whole environment's test
  double cooling_h{2.0};      ///< after running
  double every_min{5.0};      ///< a reading
  double rpm_max{0.0};        ///< of the spindle; 0: not given
  bool steps{false};          ///< speeds in steps in place of one
  double feed_mm_per_min{0};  ///< of the axis; 0: not given
  char moving{'x'};           ///< the axis that moves
};

struct SheetStep {
  double from_min{0.0};
  double to_min{0.0};
  double speed{0.0};  ///< of the spindle or feed of the axis
};

/// What runs when: a quarter of an hour of rest, running, cooling.
/// @throws ConfigurationError naming the option
[[nodiscard]] std::vector<SheetStep> sheet_steps(const SheetOptions& options);

/// A run file to be filled in: `thermal-test report` reads it.
[[nodiscard]] std::string sheet_csv(const SheetOptions& options);
/// The same for paper.
[[nodiscard]] std::string sheet_html(const SheetOptions& options);

}  // namespace thermocomp::thermal_test
