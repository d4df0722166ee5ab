/// delta = P (T - T_ref), with rows of guideways at the present position and extension terms; and
/// the distance of the machine from its model's data.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Displacement of the model's outputs from temperatures and operating signals. The same code
/// predicts offline and compensates in the daemon.
/// Sources: JP6507619B2 eq. (1) and its guideway rows; docs/methods.md for the terms.
class DisplacementModel {
 public:
  /// @throws InvalidValue when shapes or names of `model` do not fit each other
  explicit DisplacementModel(const ThermalModel& model);
  ~DisplacementModel();
  DisplacementModel(DisplacementModel&&) noexcept;
  DisplacementModel& operator=(DisplacementModel&&) noexcept;

  /// Lags restart at the next step, in the steady state of their inputs.
  void restart() noexcept;

  /// @param now              time of the values; must not run backwards
  /// @param temps_degC       shape (temperature_columns)
  /// @param reference_degC   shape (temperature_columns)
  /// @param signals          shape (signal_columns)
  /// @param displacement_um  shape (outputs); overwritten. um, or urad for a tilt
  /// @pre sizes match the model (checked), values are finite. Never throws, never allocates;
  ///      O(outputs x inputs).
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const double> reference_degC, std::span<const double> signals,
            std::span<double> displacement_um) noexcept;

  /// The derivative of an output with respect to the temperatures, at these rises and positions:
  /// matrix, guideway rows and terms. For a lagged term, the larger of its initial and its final
  /// effect.
  /// @param rise_K          shape (temperature_columns)
  /// @param signals         shape (signal_columns)
  /// @param slope_um_per_K  shape (temperature_columns); overwritten
  /// Never throws, never allocates; O(columns + terms).
  void slope(std::size_t output, std::span<const double> rise_K, std::span<const double> signals,
             std::span<double> slope_um_per_K) const noexcept;

  void visit_state(StateArchive& archive);
  /// Takes over the states of all terms. @pre made from the same model. Never allocates.
  void copy_states(const DisplacementModel& same) noexcept;
  /// Takes over the states of terms with the same kind, subject and parameters; plan[i] is the
  /// index of the other model's term for ours, or -1. See plan_terms().
  void adopt_terms(const DisplacementModel& other, std::span<const int> plan) noexcept;
  [[nodiscard]] std::vector<int> plan_terms(const DisplacementModel& other) const;

 private:
  struct Equation;
  std::unique_ptr<Equation> equation_;
};

/// Observed time and time outside in each of the last 24 hours; a new hour replaces the oldest.
class OutsideShare {
 public:
  /// @param now  must not run backwards; a gap of more than a minute counts as not observed
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

/// Standard deviation of a prediction's error [um]:
///
///     hypot(left_out_rms_um, 0.25 no_model_rms_um / runs^(1/4)).
///
/// The second part is for behaviour not shown by the runs; outside the domain runs = 1.
/// Measured machines show no further growth with the distance (docs/measurements.md).
[[nodiscard]] double spread_um(const MadeFrom& made_from, const MadeFrom::Output& output,
                               bool outside);

/// Distance of the model's inputs from the fitted rows, in the metric of their covariance S,
///
///     d^2 = (x - m)^T S^-1 (x - m) / n,
///
/// x: levels of the temperatures [degC], then, after each low pass of the domain, rises of the
/// temperatures and signals; n: their number. About 1 within the rows; large in directions that
/// were never excited. Evaluated once a second, since temperatures change slowly.
class ModelDomain {
 public:
  /// @param model  with `made_from`. @throws InvalidValue when shapes or names do not fit
  explicit ModelDomain(const ThermalModel& model);
  ~ModelDomain();
  ModelDomain(ModelDomain&&) noexcept;
  ModelDomain& operator=(ModelDomain&&) noexcept;

  /// Low passes restart at the next step.
  void restart() noexcept;
  /// Arguments as DisplacementModel::step(). Never throws, never allocates; O(n^2) once a second.
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const double> reference_degC, std::span<const double> signals) noexcept;

  [[nodiscard]] double distance() const noexcept;  ///< d; 0 before the first step
  [[nodiscard]] bool outside() const noexcept;     ///< d > distance_max
  /// Index in `made_from.columns` of the largest part of d^2, over level and low passes; O(n^2).
  [[nodiscard]] std::size_t furthest_column() const;
  /// Share of the model's displacement in use: 1 inside, (distance_max / d)^2 outside.
  [[nodiscard]] double used_share() const noexcept;
  /// spread_um() of an output at the present distance; NaN: unknown.
  [[nodiscard]] double sd_um(std::size_t output) const noexcept;

  void visit_state(StateArchive& archive);
  /// True if `other` has the same states.
  [[nodiscard]] bool alike(const ModelDomain& other) const;
  /// @pre alike(other)
  void adopt(const ModelDomain& other) noexcept;

 private:
  struct Metric;
  std::unique_ptr<Metric> metric_;
};

/// Number of features: temperatures + (temperatures + signals) x low passes.
[[nodiscard]] std::size_t domain_features(const MadeFrom& made_from);

}  // namespace thermocomp
