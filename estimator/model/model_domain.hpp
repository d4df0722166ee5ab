/// How far the machine is from where its model was made, and for which share of the last day it was
/// outside.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <span>
#include <string_view>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Hours of a day, each with the time that was looked at and the part of it that was outside. The
/// hour that is 24 h old is dropped as a new one begins.
class OutsideShare {
 public:
  /// @param now  must not run backwards; a gap of more than a minute counts as not looked at
  void step(nanoseconds now, bool outside) noexcept {
    const double gap_s = std::chrono::duration<double>(now - at_).count();
    const bool first = !started_;
    started_ = true;
    at_ = now;
    if (first || !(gap_s <= 60.0)) return;
    into_hour_s_ += gap_s;
    if (into_hour_s_ >= 3600.0) {
      into_hour_s_ = 0.0;
      hour_ = (hour_ + 1) % hours;
      looked_s_[hour_] = outside_s_[hour_] = 0.0;
    }
    looked_s_[hour_] += gap_s;
    if (outside) outside_s_[hour_] += gap_s;
  }

  /// 0 before anything was looked at.
  [[nodiscard]] double share() const noexcept {
    double looked_s = 0.0;
    double outside_s = 0.0;
    for (std::size_t i = 0; i < hours; ++i) {
      looked_s += looked_s_[i];
      outside_s += outside_s_[i];
    }
    return looked_s > 0 ? outside_s / looked_s : 0.0;
  }

  void visit_state(StateArchive& archive) {
    archive(started_, at_, into_hour_s_, hour_, looked_s_, outside_s_);
  }

 private:
  static constexpr std::size_t hours = 24;
  bool started_{false};
  nanoseconds at_{};
  double into_hour_s_{0.0};
  std::size_t hour_{0};
  std::array<double, hours> looked_s_{};
  std::array<double, hours> outside_s_{};
};

/// What a prediction may be off by [um, 1 sd]:
///
///     hypot(left_out_rms_um, 0.3 no_model_rms_um / sqrt(runs)).
///
/// The second part is what the runs have not shown; outside the domain they count as one. Further
/// growth with the distance is not in measured machines (docs/measurements.md).
[[nodiscard]] double spread_um(const MadeFrom& made_from, const MadeFrom::Output& output,
                               bool outside);

/// The distance of what the model reads from the rows that it was made from, in the metric of their
/// covariance S,
///
///     d^2 = (x - m)^T S^-1 (x - m) / n,
///
/// x: levels of the temperatures [degC], then, after each low pass of the domain, rises of the
/// temperatures and signals; n: their number. About 1 where the model was made; large in directions
/// that were never excited. Evaluated once a second, since temperatures do not move faster.
class ModelDomain {
 public:
  /// @param model  with `made_from`. @throws InvalidValue when shapes or names do not fit
  explicit ModelDomain(const ThermalModel& model);
  ~ModelDomain();
  ModelDomain(ModelDomain&&) noexcept;
  ModelDomain& operator=(ModelDomain&&) noexcept;

  /// Low passes start anew at the next step.
  void restart() noexcept;
  /// The arguments of DisplacementModel::step(). Never throws, never allocates; once a second
  /// O(n^2).
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const double> reference_degC, std::span<const double> signals) noexcept;

  [[nodiscard]] double distance() const noexcept;  ///< d; 0 before the first step
  [[nodiscard]] bool outside() const noexcept;     ///< d > distance_max
  /// Which of `made_from.columns` most of d^2 is of, its level and its past together; O(n^2).
  [[nodiscard]] std::size_t furthest_column() const;
  /// The share of the model's displacement that is still believed: 1 inside, (distance_max / d)^2
  /// outside.
  [[nodiscard]] double believed_share() const noexcept;
  /// spread_um() of an output here; NaN: nothing is known about it.
  [[nodiscard]] double sd_um(std::size_t output) const noexcept;

  void visit_state(StateArchive& archive);
  /// Whether `other` keeps the same states.
  [[nodiscard]] bool alike(const ModelDomain& other) const;
  /// @pre alike(other)
  void adopt(const ModelDomain& other) noexcept;

 private:
  struct Metric;
  std::unique_ptr<Metric> metric_;
};

/// Number of features of a domain: levels of the temperatures, then (temperatures + signals) times
/// low passes.
[[nodiscard]] std::size_t domain_features(const MadeFrom& made_from);

}  // namespace thermocomp
