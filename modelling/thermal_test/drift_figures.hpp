/// Figures of a thermal test to ISO 230-3, with intervals.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "estimator/types.hpp"
#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

/// A range with its 99 % interval, which is wider downwards, since noise increases a range.
struct Figure {
  double value{not_a_number};
  double low{not_a_number};
  double high{not_a_number};
  [[nodiscard]] bool is_there() const noexcept { return value == value; }
};

/// Range of an axis' displacement over stretches of the test.
struct AxisFigures {
  std::string name;  ///< "X"
  std::string unit;
  double noise{0.0};            ///< standard deviation of a single value
  bool smoothed{false};         ///< else values are too rare
  std::size_t values{0};        ///< number of values in the whole test
  Figure whole;                 ///< whole record
  Figure first_hour;            ///< of running, if it runs an hour
  Figure until_end;             ///< until the end of running
  Figure cooling;               ///< after running, if recorded
  Figure largest_hour;          ///< hour with the largest range; only in a test of the environment
  Figure last_by_first;         ///< ratio of the ranges of the last and the first hour of running
  std::optional<bool> settled;  ///< nullopt: undecided
  std::vector<double> time_s;   ///< of the smoothed course, from the start of running
  std::vector<double> course;   ///< relative to the start of running
};

struct TemperatureFigures {
  std::string name;
  double at_start_degC{0.0};
  double range_K{0.0};   ///< over the whole test
  double change_K{0.0};  ///< from start to end of running, or over the whole test
  bool is_room{false};
};

struct TestFigures {
  std::string file;
  TestPhases phases;
  std::vector<AxisFigures> axes;
  /// Largest distance between two places of the tool, over all linear axes.
  Figure combined_until_end;
  Figure combined_whole;
  std::size_t combined_axes{0};
  std::vector<TemperatureFigures> temperatures;
};

/// The last hour of running counts as settled below this share of the first.
inline constexpr double settled_share = 0.15;

[[nodiscard]] TestFigures figures_of(const TestData& data);
/// Likewise with an earlier end of running, for comparison with a shorter test.
[[nodiscard]] TestFigures figures_until(const TestData& data, double running_s);

/// `after` divided by `before`, relative errors add in squares, within the ends' ratios.
[[nodiscard]] Figure ratio_of(const Figure& after, const Figure& before);

}  // namespace thermocomp::thermal_test
