#include "modelling/thermal_test/drift_course.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "config/runs/robust.hpp"

namespace thermocomp::thermal_test {
namespace {

constexpr double window_s = 300.0;
constexpr double bin_s_min = 15.0;
constexpr double bins_max = 6000.0;
/// Required values of a window for a parabola.
constexpr std::size_t window_values_min = 5;
constexpr double normal_of_median = 1.4826;

/// Robust spread; for coarse values, where it is 0, the RMS.
double spread_of(const std::vector<double>& values) {
  std::vector<double> sizes;
  double squares = 0.0;
  for (const double value : values) {
    sizes.push_back(std::abs(value));
    squares += value * value;
  }
  if (values.empty()) return 0.0;
  const double robust = normal_of_median * median(std::move(sizes));
  return robust > 0.0 ? robust : std::sqrt(squares / static_cast<double>(values.size()));
}

/// Each value minus the line between its neighbours, in standard deviations of one value.
std::vector<double> second_differences(const std::vector<double>& time_s,
                                       const std::vector<double>& values) {
  std::vector<double> result;
  for (std::size_t i = 1; i + 1 < values.size(); ++i) {
    const double share = (time_s[i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1]);
    const double line = values[i - 1] + share * (values[i + 1] - values[i - 1]);
    const double scale = std::sqrt(1.0 + share * share + (1.0 - share) * (1.0 - share));
    result.push_back((values[i] - line) / scale);
  }
  return result;
}

std::size_t stretch_of(double time_s, std::span<const double> breaks_s) {
  return static_cast<std::size_t>(std::upper_bound(breaks_s.begin(), breaks_s.end(), time_s) -
                                  breaks_s.begin());
}

/// Weights for the value at `at` of the parabola through the values at `times`.
std::vector<double> parabola_weights(std::span<const double> times, double at) {
  Eigen::MatrixXd basis(static_cast<Eigen::Index>(times.size()), 3);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double x = (times[i] - at) / window_s;
    basis.row(static_cast<Eigen::Index>(i)) << 1.0, x, x * x;
  }
  const Eigen::Vector3d here(1.0, 0.0, 0.0);
  const Eigen::VectorXd weights = basis * (basis.transpose() * basis).ldlt().solve(here);
  return {weights.begin(), weights.end()};
}

}  // namespace

double noise_of(const MeasuredCourse& course) {
  if (course.value.size() < 5) return 0.0;
  return spread_of(second_differences(course.time_s, course.value));
}

SmoothCourse::SmoothCourse(const MeasuredCourse& measured, std::span<const double> breaks_s,
                           double noise)
    : noise_(std::isfinite(noise) ? noise : noise_of(measured)) {
  average_bins(measured, breaks_s);
  place_windows(breaks_s);
  value_ = smoothed(raw_);
  keep_what_is_left(noise);
  for (const auto& window : windows_) {
    double squares = 0.0;
    for (std::size_t j = 0; j < window.weights.size(); ++j)
      squares += std::pow(window.weights[j] * share_[window.begin + j], 2);
    noise_left_ = std::max(noise_left_, noise_ * std::sqrt(squares));
  }
}

/// Averages dense values over some seconds; no thermal change is faster.
void SmoothCourse::average_bins(const MeasuredCourse& measured, std::span<const double> breaks_s) {
  const auto& times = measured.time_s;
  if (times.empty()) return;
  const double bin_s = std::max(bin_s_min, (times.back() - times.front()) / bins_max);
  for (std::size_t i = 0; i < times.size();) {
    double time = 0.0;
    double sum = 0.0;
    double count = 0.0;
    const double until_s = times[i] + bin_s;
    const std::size_t stretch = stretch_of(times[i], breaks_s);
    for (; i < times.size() && times[i] < until_s && stretch_of(times[i], breaks_s) == stretch;
         ++i) {
      time += times[i];
      sum += measured.value[i];
      count += 1.0;
    }
    time_s_.push_back(time / count);
    raw_.push_back(sum / count);
    share_.push_back(1.0 / std::sqrt(count));
  }
}

void SmoothCourse::place_windows(std::span<const double> breaks_s) {
  std::size_t longest = 1;
  for (std::size_t i = 0; i < time_s_.size(); ++i) {
    const std::size_t stretch = stretch_of(time_s_[i], breaks_s);
    std::size_t begin = i;
    std::size_t end = i + 1;
    const auto belongs = [&](std::size_t j) {
      return std::abs(time_s_[j] - time_s_[i]) <= window_s / 2 &&
             stretch_of(time_s_[j], breaks_s) == stretch;
    };
    while (begin > 0 && belongs(begin - 1)) --begin;
    while (end < time_s_.size() && belongs(end)) ++end;
    if (end - begin < window_values_min) {
      windows_.push_back({i, {1.0}});
      continue;
    }
    smoothed_ = true;
    longest = std::max(longest, end - begin);
    windows_.push_back(
        {begin, parabola_weights(std::span<const double>(time_s_).subspan(begin, end - begin),
                                 time_s_[i])});
  }
  block_ = longest;
}

/// Residuals in units of a single value's noise. Smoothing removes part of the noise, by the weight
/// of a value in its own window; the scale corrects this. Unsmoothed: second differences.
void SmoothCourse::keep_what_is_left(double noise) {
  if (!smoothed_) {
    left_ = second_differences(time_s_, raw_);
    const double spread = spread_of(left_);
    for (double& value : left_) value *= spread > 0.0 ? noise_ / spread : 0.0;
    if (left_.empty() && noise_ > 0.0) left_ = {noise_, -noise_};
    return;
  }
  double squares = 0.0;
  for (std::size_t i = 0; i < raw_.size(); ++i) {
    const Window& window = windows_[i];
    if (window.weights.size() < window_values_min) continue;
    const double own = std::min(0.9, window.weights[i - window.begin]);
    left_.push_back((raw_[i] - value_[i]) / std::sqrt(1.0 - own) / share_[i]);
    squares += left_.back() * left_.back();
  }
  const double spread = std::sqrt(squares / static_cast<double>(left_.size()));
  // A given noise replaces the estimate, which is at least the spread.
  const double wanted = std::isfinite(noise) ? noise : std::max(noise_, spread);
  for (double& value : left_) value *= spread > 0.0 ? wanted / spread : 0.0;
  noise_ = wanted;
}

std::vector<double> SmoothCourse::smoothed(const std::vector<double>& values) const {
  std::vector<double> result;
  result.reserve(values.size());
  for (const Window& window : windows_) {
    double sum = 0.0;
    for (std::size_t j = 0; j < window.weights.size(); ++j)
      sum += window.weights[j] * values[window.begin + j];
    result.push_back(sum);
  }
  return result;
}

std::vector<double> SmoothCourse::noise_draw(std::mt19937_64& random) const {
  std::vector<double> drawn(raw_.size(), 0.0);
  if (left_.empty()) return drawn;
  std::uniform_int_distribution<std::size_t> anywhere(0, left_.size() - 1);
  for (std::size_t i = 0; i < drawn.size();) {
    const std::size_t from = anywhere(random);
    for (std::size_t j = 0; j < block_ && i < drawn.size(); ++j, ++i)
      drawn[i] = left_[(from + j) % left_.size()] * share_[i];
  }
  return smoothed(drawn);
}

}  // namespace thermocomp::thermal_test
