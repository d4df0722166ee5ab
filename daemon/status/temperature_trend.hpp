/// How fast the machine's temperatures change: what tells a machine that warms from an even one.
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// The temperatures of the model's columns over the last half hour, one row every few seconds.
/// Main's thread only; time is an argument.
class TemperatureTrend {
 public:
  /// Longer than the limit cycles of coolers (28 min in the recorded spindle), which are no
  /// warming.
  static constexpr nanoseconds window = std::chrono::minutes(30);
  static constexpr nanoseconds pace = std::chrono::seconds(5);
  /// Until there are a few: a machine that jumps is told from the first seconds on.
  static constexpr nanoseconds first_pace = std::chrono::seconds(1);
  static constexpr std::size_t first_rows = 60;

  struct Change {
    double rate_K_per_h{not_a_number};  ///< slope of the straight line; NaN: fewer than two values
    double span_s{0.0};                 ///< the values that it goes by are so far apart
    double farthest_K{0.0};             ///< from the present one, of all of them
    /// Warming or cooling, and by more than the resolution of a coarse module.
    [[nodiscard]] bool is_uneven() const noexcept;
  };
  /// Largest rate of a column that stands still enough for a reference [K/h]. In 32 h of a recorded
  /// spindle the fastest structural sensor stayed below 1.1 K/h in 99 % of all half hours that
  /// began 3 h after the last change of speed, and above 4.2 K/h in 95 % of those in the first hour
  /// after a rise.
  static constexpr double even_rate_K_per_h_max = 3.0;
  /// A smaller change cannot be told from the steps of a module with 0.1 K.
  static constexpr double change_K_min = 0.3;

  [[nodiscard]] bool is_due(nanoseconds now) const noexcept;
  /// @param columns  of the model; if they differ from before, all begins anew
  void note(nanoseconds now, const std::vector<std::string>& columns,
            std::span<const InputReport> inputs);
  /// @param temp_degC  of this column, now
  [[nodiscard]] Change change(std::size_t column, nanoseconds now, double temp_degC) const;

 private:
  struct Row {
    nanoseconds at{};
    std::vector<double> temps_degC;
  };
  std::vector<std::string> columns_;
  std::deque<Row> rows_;
};

}  // namespace thermocomp
