/// Phase of a machine's heating or cooling, and correction gains from a record of probed courses
/// for times without probing.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// heating: the contribution of the heat source grows; turned: it still grows, but the displacement
/// has returned from its extreme; cooling: it shrinks. A direction changes when the value has
/// returned by `back_um`, with effect from the time of its extreme. Never allocates, never throws.
/// Source: Teratani et al. 1995, section 5 (response of the tie in the course of the heat).
class HeatPhase {
 public:
  /// @param back_um  > 0, larger than the noise
  explicit HeatPhase(double back_um) noexcept : back_um_(back_um) {}

  /// @param heat_um          contribution of the heat source, of either sign
  /// @param displacement_um  of the whole model
  void step(nanoseconds now, double heat_um, double displacement_um) noexcept;
  [[nodiscard]] CoursePhase phase() const noexcept;
  /// Time since heating or cooling began [s]; 0 before the first step.
  [[nodiscard]] double since_s() const noexcept;
  /// The next step begins a heating phase.
  void restart() noexcept { state_ = {}; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  struct State {
    bool started{false};
    bool heating{true};
    bool turned{false};
    nanoseconds now{};
    nanoseconds changed_at{};
    double heat_extreme_um{0.0};  ///< maximum since heating began, minimum since cooling began
    nanoseconds extreme_at{};
    double began_um{0.0};  ///< displacement when heating began
    double away_um{0.0};   ///< largest distance from began_um
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i] = *this;
      archive(a, b, c, d, e, f, g, h, i);
    }
  };

  double back_um_;
  State state_;
};

/// Gain and standard deviation of each group of the correction.
struct RecordedGains {
  std::array<double, correction_groups_max> gain{};
  std::array<double, correction_groups_max> sd{};
};

/// Local mean of the record at a machine state. With the distance d_j of the state from point j of
/// the same phase, each quantity (time in the phase, rises of the inputs) in units of its spread
/// over the points,
///   w_j = exp(-d_j^2 / (2 h^2)),  R = (sum w_j R_j + w_0) / (sum w_j + w_0),
/// h: bandwidth of the course, w_0: weight of a point three bandwidths away. Far from all points R
/// returns to 1 and its standard deviation to gain_sd.
/// Source: Teratani et al. 1995, section 5.
class CourseLookup {
 public:
  /// @param gain_sd  standard deviation of an unknown gain
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
