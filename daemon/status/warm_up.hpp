/// How fast the machine's temperatures change, when it is warm enough, and when it is time to
/// probe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "estimator/pipeline/estimator.hpp"
#include "estimator/pipeline/report.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// The temperatures of the model's columns over the last half hour, one row every few seconds.
/// Main's thread only; time is an argument.
class TemperatureTrend {
 public:
  /// Longer than the limit cycles of coolers (28 min in the recorded spindle), which are no
  /// warming.
  static constexpr nanoseconds window = std::chrono::minutes(30);
  static constexpr nanoseconds pace = std::chrono::seconds(5);
  /// Until there are a few: a machine that jumps shows it from the first seconds on.
  static constexpr nanoseconds first_pace = std::chrono::seconds(1);
  static constexpr std::size_t first_rows = 60;

  struct Change {
    double rate_K_per_h{not_a_number};  ///< slope of the straight line; NaN: fewer than two values
    double span_s{0.0};                 ///< the values that it goes by are so far apart
    double farthest_K{0.0};             ///< from the present one, of all of them
    /// Warming or cooling, and by more than the resolution of a coarse module.
    [[nodiscard]] bool is_uneven() const noexcept;
  };
  /// Largest rate of a column that stands still enough for a reference [K/h]. In 32 h of a recorded
  /// spindle the fastest structural sensor stayed below 1.1 K/h in 99 % of all half hours that
  /// began 3 h after the last change of speed, and above 4.2 K/h in 95 % of those in the first hour
  /// after a rise.
  static constexpr double even_rate_K_per_h_max = 3.0;
  /// A smaller change cannot be distinguished from the steps of a module with 0.1 K.
  static constexpr double change_K_min = 0.3;

  [[nodiscard]] bool is_due(nanoseconds now) const noexcept;
  /// @param columns  of the model; if they differ from before, all begins anew
  void note(nanoseconds now, const std::vector<std::string>& columns,
            std::span<const InputReport> inputs);
  /// @param temp_degC  of this column, now
  [[nodiscard]] Change change(std::size_t column, nanoseconds now, double temp_degC) const;

 private:
  struct Row {
    nanoseconds at{};
    std::vector<double> temps_degC;
  };
  std::vector<std::string> columns_;
  std::deque<Row> rows_;
};

/// What is still to come of a displacement while the machine goes on as it does.
struct RemainingDrift {
  double um{not_a_number};       ///< NaN: not known
  double minutes{not_a_number};  ///< until less than the bound is to come; 0: it is less already
};

/// Extrapolates the displacement of each axis as it approaches an end in several ways at once,
///
///     d(t) = d_end + sum of a_k exp(-t / tau_k),   tau_k = 10, 30, 90, 270 min,
///
/// all a_k of one sign, by least squares over the last 240, 120, 60, 30 or 20 min: the longest of
/// them in which the curve leaves less than a tenth of the bound, so that a change of load, after
/// which another end is approached, shows in its misfit. The slowest is used only where the
/// others leave much more. How well it does: docs/measurements.md. Main's thread only; time is an
/// argument.
class WarmUp {
 public:
  static constexpr nanoseconds pace = std::chrono::minutes(1);
  static constexpr nanoseconds window = std::chrono::minutes(240);

  [[nodiscard]] bool is_due(nanoseconds now) const noexcept {
    return rows_.empty() || now - rows_.back().at >= pace;
  }
  /// @param displacement_um  one an axis; NaN: not known. Another number of axes begins anew
  void note(nanoseconds now, std::vector<double> displacement_um, double bound_um);
  /// As of the last note(); one an axis.
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

/// By how much the model may be off by now, of what the axis has moved since it was last probed, or
/// since the daemon started:
///
///     e = s / D |d - d_probed|,
///
/// s: spread_um() of the output, D: its displacement where the model was judged (RMS without a
/// model). Where [correction] learns from probings, its own spread instead.
class SinceProbing {
 public:
  /// @param model  checksum. When another one runs, the displacement of the last probing moves by
  ///               what the two models are apart at this moment
  void note(std::span<const AxisReport> axes, const std::string& model);
  /// @return NaN: the model does not say what it was made from, or the axis has no displacement
  [[nodiscard]] double error_um(std::size_t axis, const AxisReport& now, const ThermalModel& model,
                                const std::string& output, bool is_corrected) const;

 private:
  struct Probed {
    std::uint64_t probings{0};
    double displacement_um{not_a_number};
    double last_um{not_a_number};  ///< at the last note
  };
  std::string model_;
  std::vector<Probed> probed_;
};

}  // namespace thermocomp
