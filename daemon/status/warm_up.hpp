/// Rates of the temperatures, remaining warm-up drift, and the error that requests a probing.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "estimator/pipeline/estimator.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// The temperatures of the model's columns over the last half hour, one row every few seconds.
/// Main's thread only; time is an argument.
class TemperatureTrend {
 public:
  /// Longer than the limit cycles of coolers (28 min in the recorded spindle), which are not
  /// warming.
  static constexpr nanoseconds window = std::chrono::minutes(30);
  static constexpr nanoseconds pace = std::chrono::seconds(5);
  /// Period of the first rows, so that a jumping temperature shows within seconds.
  static constexpr nanoseconds first_pace = std::chrono::seconds(1);
  static constexpr std::size_t first_rows = 60;

  struct Change {
    double rate_K_per_h{not_a_number};  ///< slope of the fitted line; NaN: fewer than two values
    double span_s{0.0};                 ///< time between the first value and now
    double farthest_K{0.0};             ///< largest difference from the present value
    /// True if warming or cooling by more than the resolution of a coarse module.
    [[nodiscard]] bool is_uneven() const noexcept;
  };
  /// Largest rate of a column at rest, as needed for a reference [K/h]. In 32 h of a recorded
  /// spindle the fastest structural sensor stayed below 1.1 K/h in 99 % of all half hours that
  /// began 3 h after the last change of speed, and above 4.2 K/h in 95 % of those in the first hour
  /// after a rise.
  static constexpr double even_rate_K_per_h_max = 3.0;
  /// Smallest change distinguishable from the 0.1 K steps of a module.
  static constexpr double change_K_min = 0.3;

  [[nodiscard]] bool is_due(nanoseconds now) const noexcept;
  /// @param columns  of the model; a change discards all rows
  void note(nanoseconds now, const std::vector<std::string>& columns,
            std::span<const InputReport> inputs);
  /// @param temp_degC  present value of the column
  [[nodiscard]] Change change(std::size_t column, nanoseconds now, double temp_degC) const;

 private:
  struct Row {
    nanoseconds at{};
    std::vector<double> temps_degC;
  };
  std::vector<std::string> columns_;
  std::deque<Row> rows_;
};

/// Displacement still to come if the load stays constant.
struct RemainingDrift {
  double um{not_a_number};       ///< NaN: unknown
  double minutes{not_a_number};  ///< until less than the bound remains; 0: already so
};

/// Extrapolates the displacement of each axis as a sum of exponentials:
///
///     d(t) = d_end + sum of a_k exp(-t / tau_k),   tau_k = 10, 30, 90, 270 min,
///
/// all a_k of one sign, by least squares over the longest of 240, 120, 60, 30 or 20 min with an RMS
/// misfit below a tenth of the bound: a change of load changes d_end and so causes misfit. The
/// slowest tau is used only if the others fit much worse. Accuracy: docs/measurements.md. Main's
/// thread only; time is an argument.
class WarmUp {
 public:
  static constexpr nanoseconds pace = std::chrono::minutes(1);
  static constexpr nanoseconds window = std::chrono::minutes(240);

  [[nodiscard]] bool is_due(nanoseconds now) const noexcept {
    return rows_.empty() || now - rows_.back().at >= pace;
  }
  /// @param displacement_um  per axis; NaN: unknown. Another number of axes discards all rows
  void note(nanoseconds now, std::vector<double> displacement_um, double bound_um);
  /// Per axis, as of the last note().
  [[nodiscard]] const std::vector<RemainingDrift>& remaining() const noexcept { return remaining_; }

 private:
  struct Row {
    nanoseconds at{};
    std::vector<double> displacement_um;
  };
  [[nodiscard]] RemainingDrift remaining_of(std::size_t axis, double bound_um) const;

  std::deque<Row> rows_;
  std::vector<RemainingDrift> remaining_;
};

/// Error of the model, from the axis' movement since it was last probed or the daemon started:
///
///     e = s / D |d - d_probed|,
///
/// s: spread_um() of the output, D: its RMS displacement in the runs left out of the fit. With
/// [correction] in use, its own standard deviation instead.
class SinceProbing {
 public:
  /// @param model  checksum. A change shifts the displacement of the last probing by the present
  ///               difference of the two models
  void note(std::span<const AxisReport> axes, const std::string& model);
  /// @return NaN: the model file has no data on its origin, or the displacement is unknown
  [[nodiscard]] double error_um(std::size_t axis, const AxisReport& now, const ThermalModel& model,
                                const std::string& output, bool is_corrected) const;

 private:
  struct Probed {
    std::uint64_t probings{0};
    double displacement_um{not_a_number};
    double last_um{not_a_number};  ///< at the last note()
  };
  std::string model_;
  std::vector<Probed> probed_;
};

}  // namespace thermocomp
