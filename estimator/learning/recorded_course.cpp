#include "estimator/learning/recorded_course.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {

void HeatPhase::step(nanoseconds now, double heat_um, double displacement_um) noexcept {
  const double size_um = std::abs(heat_um);
  State& s = state_;
  if (!s.started) s = {true, true, false, now, now, size_um, now, displacement_um, 0.0};
  s.now = now;
  if (s.heating ? size_um >= s.heat_extreme_um : size_um <= s.heat_extreme_um) {
    s.heat_extreme_um = size_um;
    s.extreme_at = now;
  }
  if (std::abs(size_um - s.heat_extreme_um) > back_um_) {
    s.heating = !s.heating;
    s.changed_at = s.extreme_at;
    s.heat_extreme_um = size_um;
    s.extreme_at = now;
    s.turned = false;
    s.began_um = displacement_um;
    s.away_um = 0.0;
  }
  const double away_um = std::abs(displacement_um - s.began_um);
  if (away_um > s.away_um) s.away_um = away_um;
  if (s.heating && s.away_um - away_um > back_um_) s.turned = true;
}

CoursePhase HeatPhase::phase() const noexcept {
  if (!state_.heating) return CoursePhase::cooling;
  return state_.turned ? CoursePhase::turned : CoursePhase::heating;
}

double HeatPhase::since_s() const noexcept {
  return std::chrono::duration<double>(state_.now - state_.changed_at).count();
}

namespace {

constexpr double unknown_at_bandwidths = 3.0;
// Smallest spreads: a quantity not varied in the record must not select the nearest point.
constexpr double since_spread_s_min = 60.0;
constexpr double rise_spread_K_min = 0.5;

template <class Value>
double spread(const std::vector<RecordedCourse::Point>& points, Value&& value) {
  double sum = 0.0;
  double squares = 0.0;
  const auto count = static_cast<double>(points.size());
  for (const RecordedCourse::Point& point : points) sum += value(point);
  for (const RecordedCourse::Point& point : points) {
    const double off = value(point) - sum / count;
    squares += off * off;
  }
  return std::sqrt(squares / count);
}

}  // namespace

CourseLookup::CourseLookup(const RecordedCourse& course, const ThermalModel& model,
                           std::size_t output, double gain_sd)
    : groups_(course.groups.size()), bandwidth_(course.bandwidth), gain_sd_(gain_sd) {
  const auto found = course.outputs.find(model.outputs[output]);
  if (found != course.outputs.end()) points_ = found->second;
  require(groups_ >= 1 && groups_ <= correction_groups_max, "course.groups",
          static_cast<double>(groups_), "must be 1 to 4 groups");
  require(bandwidth_ > 0, "course.bandwidth", bandwidth_, "must be above 0");
  for (const RecordedCourse::Point& point : points_)
    require(point.rise_K.size() == model.inputs.size() && point.gain.size() == groups_ &&
                point.sd.size() == groups_,
            "course.points", static_cast<double>(point.rise_K.size()),
            "must have a rise for each input, a gain and a deviation for each group");
  if (points_.empty()) return;
  since_spread_s_ = std::max(since_spread_s_min,
                             spread(points_, [](const auto& point) { return point.since_s; }));
  for (std::size_t i = 0; i < model.inputs.size(); ++i)
    rise_spread_K_.push_back(std::max(
        rise_spread_K_min, spread(points_, [i](const auto& point) { return point.rise_K[i]; })));
}

double CourseLookup::distance2(const RecordedCourse::Point& point, double since_s,
                               std::span<const double> rise_K) const noexcept {
  const double since = (since_s - point.since_s) / since_spread_s_;
  double sum = since * since;
  for (std::size_t i = 0; i < rise_spread_K_.size(); ++i) {
    const double rise = (rise_K[i] - point.rise_K[i]) / rise_spread_K_[i];
    sum += rise * rise;
  }
  return sum;
}

RecordedGains CourseLookup::at(CoursePhase phase, double since_s,
                               std::span<const double> rise_K) const noexcept {
  const double scale = -0.5 / (bandwidth_ * bandwidth_);
  const double unknown = std::exp(-0.5 * unknown_at_bandwidths * unknown_at_bandwidths);
  double sum = unknown;
  std::array<double, correction_groups_max> first{};
  std::array<double, correction_groups_max> second{};
  for (std::size_t g = 0; g < groups_; ++g) {
    first[g] = unknown;
    second[g] = unknown * (1.0 + gain_sd_ * gain_sd_);
  }
  for (const RecordedCourse::Point& point : points_) {
    if (point.phase != phase) continue;
    const double weight = std::exp(scale * distance2(point, since_s, rise_K));
    sum += weight;
    for (std::size_t g = 0; g < groups_; ++g) {
      first[g] += weight * point.gain[g];
      second[g] += weight * (point.gain[g] * point.gain[g] + point.sd[g] * point.sd[g]);
    }
  }
  RecordedGains found;
  for (std::size_t g = 0; g < groups_; ++g) {
    found.gain[g] = first[g] / sum;
    found.sd[g] = std::sqrt(std::max(0.0, second[g] / sum - found.gain[g] * found.gain[g]));
  }
  return found;
}

}  // namespace thermocomp
