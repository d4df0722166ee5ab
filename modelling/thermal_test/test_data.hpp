/// What a test of thermal behaviour recorded, by axes and phases; which column is which axis.
#pragma once

#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/thermal_test/drift_course.hpp"

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
