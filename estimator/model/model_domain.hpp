/// How far the machine is from where its model was made.
#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <string_view>

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// What a prediction may be off by [um, 1 sd] at states of the record: the left-out error of whole
/// runs, or (freedom 1) of the halves of one. Of one run cut in stretches (fit up to 0.2.0), which
/// leave a third of what another day does: middle of the logarithms of that and of no model.
[[nodiscard]] double spread_um(const MadeFrom& made_from, const MadeFrom::Output& output);

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
  /// Standard deviation of a new value of an output: spread_um() times sqrt(max(1, d)): gains that
  /// were penalised err less than in proportion to the distance. NaN: nothing is known about the
  /// output.
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
