/// The figures of a test of thermal behaviour, after ISO 230-3, each with its interval.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

/// A range with its 99 % interval. Noise can only make a range larger, so the interval reaches
/// further down than up.
struct Figure {
  double value{std::numeric_limits<double>::quiet_NaN()};
  double low{std::numeric_limits<double>::quiet_NaN()};
  double high{std::numeric_limits<double>::quiet_NaN()};
  [[nodiscard]] bool is_there() const noexcept { return value == value; }
};

/// Largest less smallest displacement of an axis over a stretch of the test.
struct AxisFigures {
  std::string name;  ///< "X"
  std::string unit;
  double noise{0.0};            ///< standard deviation of a single value
  bool smoothed{false};         ///< else values are too rare for it
  std::size_t values{0};        ///< measured, in the whole test
  Figure whole;                 ///< over all that was recorded
  Figure first_hour;            ///< of running; where it runs an hour
  Figure until_end;             ///< of running
  Figure cooling;               ///< after it; where some was recorded
  Figure largest_hour;          ///< the hour with the largest range; test of the environment alone
  Figure last_by_first;         ///< range of the last hour of running by that of the first; ratio
  std::optional<bool> settled;  ///< nullopt: cannot be told
  std::vector<double> time_s;   ///< of the smoothed course, from the begin of running
  std::vector<double> course;   ///< relative to that moment
};

struct TemperatureFigures {
  std::string name;
  double at_start_degC{0.0};
  double range_K{0.0};   ///< over the whole test
  double change_K{0.0};  ///< from the begin of running to its end, or over the whole test
  bool is_room{false};
};

struct TestFigures {
  std::string file;
  TestPhases phases;
  std::vector<AxisFigures> axes;
  /// Largest distance between two places of the tool, of the linear axes together.
  Figure combined_until_end;
  Figure combined_whole;
  std::size_t combined_axes{0};
  std::vector<TemperatureFigures> temperatures;
};

/// Share of the first hour below which the last hour of running counts as settled.
inline constexpr double settled_share = 0.15;

[[nodiscard]] TestFigures figures_of(const TestData& data);
/// The same with an earlier end of running, for a comparison with a shorter test.
[[nodiscard]] TestFigures figures_until(const TestData& data, double running_s);

/// `after` divided by `before`. Their errors count as independent: squares add, as far as
/// the ratios of their ends.
[[nodiscard]] Figure ratio_of(const Figure& after, const Figure& before);

}  // namespace thermocomp::thermal_test
