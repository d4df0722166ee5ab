/// What a test of thermal behaviour recorded, by axes and phases.
#pragma once

#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/thermal_test/axis_binding.hpp"
#include "modelling/thermal_test/drift_course.hpp"

namespace thermocomp::thermal_test {

/// Running is [running_from_s, running_to_s]; the record is [from_s, to_s], in the
/// time of its file. The first moment is that of the last row before anything ran.
struct TestPhases {
  double from_s{0.0};
  double to_s{0.0};
  bool runs{false};  ///< false: the environment's test
  double running_from_s{0.0};
  double running_to_s{0.0};
  std::string said;  ///< how that was found, for a person
};

struct TestAxis {
  std::string name;     ///< "X", "B", "X at 2"
  std::string from;     ///< the columns it was made from
  std::string unit;     ///< "um", "urad"
  bool is_place{true};  ///< a coordinate of the tool: no tilt, no growth, no second position
  double noise{-1.0};   ///< given; below 0: from the values
  MeasuredCourse measured;
};

struct TestTemperature {
  std::string name;
  std::vector<double> time_s;
  std::vector<double> temp_degC;
  bool is_room{false};
};

struct TestData {
  TestKind kind{TestKind::spindle};
  std::string file;
  TestPhases phases;
  std::vector<TestAxis> axes;
  std::vector<TestTemperature> temperatures;
  std::string speed_name;  ///< empty: no column of it
  std::vector<double> speed_time_s;
  std::vector<double> speed;
  std::vector<double> breaks_s;   ///< at which the speed changed
  std::vector<std::string> said;  ///< how columns were read, one line each
};

/// @throws ConfigurationError naming the file and the line to write
[[nodiscard]] TestData test_data(const RunFile& run, const TestOptions& options);

}  // namespace thermocomp::thermal_test
