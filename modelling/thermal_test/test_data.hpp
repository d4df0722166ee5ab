/// Record of a thermal test by axes and phases, and the assignment of columns to axes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp::thermal_test {

enum class TestKind { environment, spindle, axis };
[[nodiscard]] std::string to_string(TestKind kind);

/// Given assignments of columns; empty: by their names.
struct TestOptions {
  TestKind kind{TestKind::spindle};
  std::vector<std::string> axes;  ///< "z=ch5_um", "a=ch3_um-ch4_um/150mm"
  std::string running;            ///< column that is nonzero while running, or "T0:T1" in seconds
  std::string room;               ///< room temperature column
  double distance_mm{0.0};        ///< between the probes x1 and x2, y1 and y2; 0: unknown
  double noise_um{-1.0};          ///< standard deviation of a value; negative: from the values
};

/// A displacement, or a tilt: difference of two displacements divided by their distance.
struct AxisBinding {
  std::string axis;  ///< "x", "b", "x2"
  std::string column;
  std::string less;         ///< the second probe; empty: none
  double distance_mm{0.0};  ///< between the two probes
};

/// Assignments by `--axis`, else by the names of the columns.
/// @throws ConfigurationError naming the value and the rule
[[nodiscard]] std::vector<AxisBinding> bind_axes(const RunFile& run, const TestOptions& options);

/// "X", "X at position 2"
[[nodiscard]] std::string axis_words(const std::string& axis);

/// Running is [running_from_s, running_to_s], the record [from_s, to_s], in the file's time.
/// Running begins at the last row before anything ran.
struct TestPhases {
  double from_s{0.0};
  double to_s{0.0};
  bool runs{false};  ///< false: test of the environment
  double running_from_s{0.0};
  double running_to_s{0.0};
  std::string description;  ///< sentence on how the phases were found
};

/// Values of a probe without missing ones.
struct MeasuredCourse {
  std::vector<double> time_s;
  std::vector<double> value;
};

struct TestAxis {
  std::string name;     ///< "X", "B", "X at 2"
  std::string from;     ///< source columns
  std::string unit;     ///< "um", "urad"
  bool is_place{true};  ///< a coordinate of the tool, not a tilt, growth or second position
  double noise{-1.0};   ///< given noise; negative: from the values
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
  std::string speed_name;  ///< empty: no such column
  std::vector<double> speed_time_s;
  std::vector<double> speed;
  std::vector<double> breaks_s;          ///< times of speed changes
  std::optional<bool> compensated;       ///< an offset was read back; nullopt: not recorded
  std::vector<std::string> left_out;     ///< axes of probes that never moved; sentences
  std::vector<std::string> description;  ///< interpretation of the columns, one line each
};

/// @throws ConfigurationError naming the file and the option to write
[[nodiscard]] TestData test_data(const RunFile& run, const TestOptions& options);

}  // namespace thermocomp::thermal_test
