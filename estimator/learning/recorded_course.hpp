/// Gains of a correction from a record of probed courses, where nothing is probed.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "estimator/correction_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// One value per group of the correction, with standard deviation.
struct RecordedGains {
  std::array<double, correction_groups_max> gain{};
  std::array<double, correction_groups_max> sd{};
};

/// The record's local mean at a state of the machine. With the distance d_j of the state from point
/// j of the same phase, each quantity (time since the heat changed, rises of the inputs) in units
/// of its spread over the points,
///   w_j = exp(-d_j^2 / (2 h^2)),  R = (sum w_j R_j + w_0) / (sum w_j + w_0),
/// h the course's bandwidth and w_0 the weight of a point three bandwidths away: so far from any
/// point nothing is known, R goes back to 1 and its spread to gain_sd.
/// Source: Teratani et al. 1995, section 5.
class CourseLookup {
 public:
  /// @param gain_sd  spread of a gain of which nothing is known
  /// @throws InvalidValue when the points do not fit the model
  CourseLookup(const RecordedCourse& course, const ThermalModel& model, std::size_t output,
               double gain_sd);

  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  /// @param rise_K  shape (temperature_columns()), the model's inputs first
  /// Never throws, never allocates; O(points x inputs).
  [[nodiscard]] RecordedGains at(CoursePhase phase, double since_s,
                                 std::span<const double> rise_K) const noexcept;

 private:
  [[nodiscard]] double distance2(const RecordedCourse::Point& point, double since_s,
                                 std::span<const double> rise_K) const noexcept;

  std::vector<RecordedCourse::Point> points_;
  std::size_t groups_;
  double bandwidth_;
  double gain_sd_;
  double since_spread_s_{0.0};
  std::vector<double> rise_spread_K_;  ///< one per input
};

}  // namespace thermocomp
