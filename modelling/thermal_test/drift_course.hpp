/// Smoothed course of one displacement in a test, with its noise.
#pragma once

#include <cstddef>
#include <random>
#include <span>
#include <string>
#include <vector>

namespace thermocomp::thermal_test {

/// Values of a probe without missing ones.
struct MeasuredCourse {
  std::vector<double> time_s;
  std::vector<double> value;
};

/// Smoothing by local parabolas over a few minutes, but not across changes of speed, where a
/// machine may jump. Values too rare for that are kept.
class SmoothCourse {
 public:
  /// @param breaks_s  times of speed changes, increasing
  /// @param noise  standard deviation of a single value; NaN: estimated from the values
  SmoothCourse(const MeasuredCourse& measured, std::span<const double> breaks_s, double noise);

  [[nodiscard]] const std::vector<double>& time_s() const noexcept { return time_s_; }
  [[nodiscard]] const std::vector<double>& value() const noexcept { return value_; }
  /// Standard deviation of a single measured value, from second differences, which have a known
  /// share of white noise.
  [[nodiscard]] double noise() const noexcept { return noise_; }
  [[nodiscard]] bool is_smoothed() const noexcept { return smoothed_; }
  /// Largest standard deviation of a smoothed value.
  [[nodiscard]] double noise_left() const noexcept { return noise_left_; }

  /// Draws noise, smoothed like the values: residuals in blocks of a window, to keep their
  /// correlation.
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
  std::vector<double> share_;  ///< standard deviation of a bin's mean, relative to a value's
  std::vector<Window> windows_;
  std::vector<double> value_;
  std::vector<double> left_;  ///< residuals, scaled to the noise of one value
  std::size_t block_{1};
  double noise_{0.0};
  double noise_left_{0.0};
  bool smoothed_{false};
};

/// Robust standard deviation of single values from second differences; 0 for fewer than 5 values.
[[nodiscard]] double noise_of(const MeasuredCourse& course);

}  // namespace thermocomp::thermal_test
