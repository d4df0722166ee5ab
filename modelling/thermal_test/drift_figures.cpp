#include "modelling/thermal_test/drift_figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <span>

#include <Eigen/Dense>

#include "config/runs/robust.hpp"
#include "estimator/types.hpp"

namespace thermocomp::thermal_test {
namespace {

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

/// Robust standard deviation of single values from second differences; 0 for fewer than 5 values.
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

/// Residuals in units of a single value's noise. The scale corrects for the noise that smoothing
/// removes, by the weight of a value in its own window. Unsmoothed: second differences.
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

constexpr double hour_s = 3600.0;
// High quantile, since all of a report's dozen figures must hold for an acceptance.
constexpr int draws_count = 1000;
constexpr double draws_quantile = 0.995;
constexpr double normal_995 = 2.576;
constexpr std::uint64_t seed = 230;
/// Step between the hours tried for the largest hour.
constexpr double hours_step_s = 300.0;
constexpr std::size_t combined_points = 240;

struct Stretch {
  std::size_t begin{0};
  std::size_t end{0};
  [[nodiscard]] bool has_range() const noexcept { return end > begin + 1; }
};

/// From the last value at or before `from_s` (or the first one) to the last at or before `to_s`, so
/// that the displacement is relative to the state before.
Stretch stretch_between(const std::vector<double>& time_s, double from_s, double to_s) {
  const auto begin = std::upper_bound(time_s.begin(), time_s.end(), from_s);
  const auto end = std::upper_bound(time_s.begin(), time_s.end(), to_s);
  const auto at = [&](auto place) { return static_cast<std::size_t>(place - time_s.begin()); };
  return {begin == time_s.begin() ? 0 : at(begin) - 1, at(end)};
}

double range_of(const std::vector<double>& values, Stretch stretch) {
  if (!stretch.has_range()) return not_a_number;
  const auto from = values.begin() + static_cast<std::ptrdiff_t>(stretch.begin);
  const auto to = values.begin() + static_cast<std::ptrdiff_t>(stretch.end);
  const auto [low, high] = std::minmax_element(from, to);
  return *high - *low;
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(place))];
}

/// The range of course plus noise is at most the sum of their ranges, and at least the difference
/// between the course's two extreme moments.
Figure with_interval(double value, std::vector<double> noise_ranges, double noise_left) {
  Figure figure;
  if (!std::isfinite(value)) return figure;
  figure.value = value;
  figure.low = std::max(0.0, value - quantile(std::move(noise_ranges), draws_quantile));
  figure.high = value + normal_995 * std::sqrt(2.0) * noise_left;
  return figure;
}

enum class Part { whole, first_hour, last_hour, until_end, cooling, largest_hour };

/// Stretches of a part; for the largest hour, all hours tried.
std::vector<Stretch> stretches_of(Part part, const std::vector<double>& time_s,
                                  const TestPhases& phases, double running_to_s) {
  const double from_s = phases.running_from_s;
  switch (part) {
    case Part::whole:
      return {{0, time_s.size()}};
    case Part::first_hour:
      if (!phases.runs || running_to_s - from_s < hour_s) return {};
      return {stretch_between(time_s, from_s, from_s + hour_s)};
    case Part::last_hour:
      if (!phases.runs || running_to_s - from_s < 2.0 * hour_s) return {};
      return {stretch_between(time_s, running_to_s - hour_s, running_to_s)};
    case Part::until_end:
      if (!phases.runs) return {};
      return {stretch_between(time_s, from_s, running_to_s)};
    case Part::cooling:
      if (!phases.runs || !(phases.to_s > phases.running_to_s)) return {};
      return {stretch_between(time_s, phases.running_to_s, phases.to_s)};
    case Part::largest_hour:
      break;
  }
  std::vector<Stretch> hours;
  if (phases.runs || phases.to_s - phases.from_s < hour_s) return hours;
  for (double from = phases.from_s; from + hour_s <= phases.to_s; from += hours_step_s) {
    const Stretch hour = stretch_between(time_s, from, from + hour_s);
    // The value before the hour may be hours old if values are rare.
    if (hour.end > hour.begin && time_s[hour.end - 1] - time_s[hour.begin] <= 1.25 * hour_s)
      hours.push_back(hour);
  }
  return hours;
}

double largest_range(const std::vector<double>& values, const std::vector<Stretch>& stretches) {
  double largest = not_a_number;
  for (const Stretch stretch : stretches) largest = std::fmax(largest, range_of(values, stretch));
  return largest;
}

constexpr Part parts[] = {Part::whole,     Part::first_hour, Part::last_hour,
                          Part::until_end, Part::cooling,    Part::largest_hour};

std::map<Part, Figure> ranges_of(const SmoothCourse& course, const TestPhases& phases,
                                 double running_to_s) {
  std::map<Part, std::vector<Stretch>> stretches;
  std::map<Part, std::vector<double>> noise;
  for (const Part part : parts)
    stretches[part] = stretches_of(part, course.time_s(), phases, running_to_s);
  std::mt19937_64 random(seed);
  for (int draw = 0; draw < draws_count; ++draw) {
    const std::vector<double> drawn = course.noise_draw(random);
    for (const Part part : parts) {
      const double range = largest_range(drawn, stretches[part]);
      noise[part].push_back(std::isfinite(range) ? range : 0.0);
    }
  }
  std::map<Part, Figure> figures;
  for (const Part part : parts)
    figures[part] = with_interval(largest_range(course.value(), stretches[part]), noise[part],
                                  course.noise_left());
  return figures;
}

std::optional<bool> is_settled(const AxisFigures& axis) {
  if (!axis.last_by_first.is_there() || !(axis.first_hour.low > 0.0)) return std::nullopt;
  if (axis.last_by_first.high < settled_share) return true;
  if (axis.last_by_first.low > settled_share) return false;
  return std::nullopt;
}

AxisFigures axis_figures(const TestAxis& axis, const SmoothCourse& course, const TestData& data,
                         double running_to_s) {
  AxisFigures figures;
  figures.name = axis.name;
  figures.unit = axis.unit;
  figures.noise = course.noise();
  figures.smoothed = course.is_smoothed();
  figures.values = axis.measured.value.size();
  std::map<Part, Figure> ranges = ranges_of(course, data.phases, running_to_s);
  figures.whole = ranges[Part::whole];
  figures.first_hour = ranges[Part::first_hour];
  figures.until_end = ranges[Part::until_end];
  figures.cooling = ranges[Part::cooling];
  figures.largest_hour = ranges[Part::largest_hour];
  figures.last_by_first = ratio_of(ranges[Part::last_hour], figures.first_hour);
  figures.settled = is_settled(figures);
  const double zero_s = data.phases.runs ? data.phases.running_from_s : data.phases.from_s;
  const std::size_t zero = stretch_between(course.time_s(), zero_s, zero_s).begin;
  for (std::size_t i = 0; i < course.value().size(); ++i) {
    figures.time_s.push_back(course.time_s()[i] - zero_s);
    figures.course.push_back(course.value()[i] - course.value()[zero]);
  }
  return figures;
}

double interpolated(const std::vector<double>& time_s, const std::vector<double>& values,
                    double at_s) {
  const auto after = std::lower_bound(time_s.begin(), time_s.end(), at_s);
  if (after == time_s.begin()) return values.front();
  if (after == time_s.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - time_s.begin());
  const double share = (at_s - time_s[i - 1]) / (time_s[i] - time_s[i - 1]);
  return values[i - 1] + share * (values[i] - values[i - 1]);
}

/// Largest distance between two places on the path of all axes.
double largest_distance(const std::vector<const SmoothCourse*>& courses,
                        const std::vector<std::vector<double>>& values, double from_s,
                        double to_s) {
  std::vector<std::vector<double>> places(combined_points);
  for (std::size_t point = 0; point < combined_points; ++point) {
    const double share = static_cast<double>(point) / static_cast<double>(combined_points - 1);
    for (std::size_t axis = 0; axis < courses.size(); ++axis)
      places[point].push_back(
          interpolated(courses[axis]->time_s(), values[axis], from_s + share * (to_s - from_s)));
  }
  double largest = 0.0;
  for (std::size_t i = 0; i < combined_points; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      double squares = 0.0;
      for (std::size_t axis = 0; axis < courses.size(); ++axis)
        squares += (places[i][axis] - places[j][axis]) * (places[i][axis] - places[j][axis]);
      largest = std::max(largest, squares);
    }
  return std::sqrt(largest);
}

Figure combined(const std::vector<const SmoothCourse*>& courses, double from_s, double to_s) {
  if (courses.empty() || !(to_s > from_s)) return {};
  std::vector<std::vector<double>> values;
  double noise_left = 0.0;
  for (const SmoothCourse* course : courses) {
    values.push_back(course->value());
    noise_left = std::max(noise_left, course->noise_left());
  }
  const double distance = largest_distance(courses, values, from_s, to_s);
  std::mt19937_64 random(seed);
  std::vector<double> noise;
  for (int draw = 0; draw < draws_count / 4; ++draw) {
    for (std::size_t axis = 0; axis < courses.size(); ++axis)
      values[axis] = courses[axis]->noise_draw(random);
    noise.push_back(largest_distance(courses, values, from_s, to_s));
  }
  return with_interval(distance, std::move(noise), noise_left);
}

TemperatureFigures temperature_figures(const TestTemperature& temperature,
                                       const TestPhases& phases) {
  TemperatureFigures figures;
  figures.name = temperature.name;
  figures.is_room = temperature.is_room;
  figures.range_K = range_of(temperature.temp_degC, {0, temperature.temp_degC.size()});
  if (!std::isfinite(figures.range_K)) figures.range_K = 0.0;
  const double from_s = phases.runs ? phases.running_from_s : phases.from_s;
  const double to_s = phases.runs ? phases.running_to_s : phases.to_s;
  figures.at_start_degC = interpolated(temperature.time_s, temperature.temp_degC, from_s);
  figures.change_K =
      interpolated(temperature.time_s, temperature.temp_degC, to_s) - figures.at_start_degC;
  return figures;
}

TestFigures figures_with_end(const TestData& data, double running_to_s) {
  TestFigures figures;
  figures.file = data.file;
  figures.phases = data.phases;
  std::vector<SmoothCourse> courses;
  courses.reserve(data.axes.size());
  for (const TestAxis& axis : data.axes) {
    courses.emplace_back(axis.measured, data.breaks_s,
                         axis.noise >= 0.0 ? axis.noise : not_a_number);
    figures.axes.push_back(axis_figures(axis, courses.back(), data, running_to_s));
  }
  std::vector<const SmoothCourse*> linear;
  for (std::size_t i = 0; i < courses.size(); ++i)
    if (data.axes[i].is_place) linear.push_back(&courses[i]);
  figures.combined_axes = linear.size();
  if (linear.size() > 1) {
    figures.combined_whole = combined(linear, data.phases.from_s, data.phases.to_s);
    if (data.phases.runs)
      figures.combined_until_end = combined(linear, data.phases.running_from_s, running_to_s);
  }
  for (const TestTemperature& temperature : data.temperatures)
    figures.temperatures.push_back(temperature_figures(temperature, data.phases));
  return figures;
}

}  // namespace

TestFigures figures_of(const TestData& data) {
  return figures_with_end(data, data.phases.running_to_s);
}

TestFigures figures_until(const TestData& data, double running_s) {
  return figures_with_end(data, data.phases.running_from_s + running_s);
}

Figure ratio_of(const Figure& after, const Figure& before) {
  Figure ratio;
  if (!after.is_there() || !before.is_there() || !(before.value > 0.0)) return ratio;
  ratio.value = after.value / before.value;
  const auto share = [](double error, double of) { return of > 0.0 ? error / of : 0.0; };
  const double down = std::hypot(share(after.value - after.low, after.value),
                                 share(before.high - before.value, before.value));
  const double up = std::hypot(share(after.high - after.value, after.value),
                               share(before.value - before.low, before.value));
  // Limited by the ratios of opposite ends, a tighter bound for a small `after`.
  ratio.low = std::max(after.low / before.high, ratio.value * (1.0 - down));
  // A range `before` that may be zero does not bound the ratio.
  if (before.low > 0.0)
    ratio.high = std::min(after.high / before.low, ratio.value / std::max(0.05, 1.0 - up));
  return ratio;
}

}  // namespace thermocomp::thermal_test
