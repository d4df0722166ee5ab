/// The course of one displacement in a test, smoothed, with its noise known.
#pragma once

#include <cstddef>
#include <random>
#include <span>
#include <string>
#include <vector>

namespace thermocomp::thermal_test {

/// As a probe gave it; no missing values.
struct MeasuredCourse {
  std::vector<double> time_s;
  std::vector<double> value;
};

/// Local parabolas over a few minutes, never across a moment at which the speed changed: a machine
/// may jump there. Where values are too rare for that they stay as they are.
class SmoothCourse {
 public:
  /// @param breaks_s  the moments at which the speed changed, increasing
  /// @param noise  standard deviation of a single value where it is known; NaN: from the values
  SmoothCourse(const MeasuredCourse& measured, std::span<const double> breaks_s, double noise);

  [[nodiscard]] const std::vector<double>& time_s() const noexcept { return time_s_; }
  [[nodiscard]] const std::vector<double>& value() const noexcept { return value_; }
  /// Standard deviation of a single value as measured, from second differences: what is left of a
  /// value after the straight line between its neighbours is white noise of a known share.
  [[nodiscard]] double noise() const noexcept { return noise_; }
  /// Whether values are close enough together that they were smoothed.
  [[nodiscard]] bool is_smoothed() const noexcept { return smoothed_; }
  /// Largest standard deviation of a smoothed value.
  [[nodiscard]] double noise_left() const noexcept { return noise_left_; }

  /// The noise alone, smoothed as the values were: what was left of them is drawn anew in blocks as
  /// long as a window, so that noise that lasts keeps lasting.
  [[nodiscard]] std::vector<double> noise_draw(std::mt19937_64& random) const;

 private:
  struct Window {
    std::size_t begin{0};
    std::vector<double> weights;
  };
  void average_bins(const MeasuredCourse& measured, std::span<const double> breaks_s);
  void place_windows(std::span<const double> breaks_s);
  void keep_what_is_left(double noise);
  [[nodiscard]] std::vector<double> smoothed(const std::vector<double>& values) const;

  std::vector<double> time_s_;
  std::vector<double> raw_;
  std::vector<double> share_;  ///< standard deviation of a bin's mean, in those of a value
  std::vector<Window> windows_;
  std::vector<double> value_;
  std::vector<double> left_;  ///< of the values, scaled to the noise of one
  std::size_t block_{1};
  double noise_{0.0};
  double noise_left_{0.0};
  bool smoothed_{false};
};

/// Robust standard deviation of single values from second differences; 0 for fewer than 5 values.
[[nodiscard]] double noise_of(const MeasuredCourse& course);

}  // namespace thermocomp::thermal_test
