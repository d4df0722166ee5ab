/// Displacement along the travel of axes whose controller interpolates, and its values at the nodes
/// sent to the controller.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// y = at_first + (at_last - at_first) (x - x_first) / (x_last - x_first)
struct CurveLine {
  double at_first{0.0};
  double at_last{0.0};
  double deviation{0.0};  ///< largest |y_i - line(x_i)|
};

/// The line with the smallest maximum deviation from the points: three of them are at equal
/// distances on alternating sides, no other is farther off. NaN if a value is not finite.
/// @param x  strictly increasing, two points at least
/// @param y  shape (x)
/// Never throws, never allocates.
/// Source: E. Ya. Remez, exchange algorithm for a polynomial of the first degree on a finite set.
[[nodiscard]] CurveLine minimax_line(std::span<const double> x, std::span<const double> y) noexcept;

/// Sample positions of an output's curve, increasing: its kinks (positions of guideways) and `even`
/// equidistant places, both ends included.
[[nodiscard]] std::vector<double> travel_samples_mm(const ThermalModel& model,
                                                    const std::string& position, double low_mm,
                                                    double high_mm, std::size_t even);

/// Offsets at the nodes: for a table the curve itself, for a line the ends of its minimax line.
class TravelCurves {
 public:
  /// @throws InvalidValue for a position that is not a signal of the model, or nodes out of order
  TravelCurves(const EstimatorConfig& config, const ThermalModel& model);

  [[nodiscard]] bool empty() const noexcept { return travels_.empty(); }

  /// @param evaluate  (signals, displacement_um of the outputs): the model at the present time with
  /// the slides at these positions; must not change its state
  /// @param signals   shape (signal_columns), present values
  /// @param axis_um   one per axis; only nodes are overwritten
  /// Never allocates.
  template <class Evaluate>
  void step(Evaluate&& evaluate, std::span<const double> signals,
            std::span<double> axis_um) noexcept {
    for (Travel& travel : travels_) {
      begin(signals);
      for (std::size_t i = 0; i < travel.at_mm.size(); ++i) {
        signals_[travel.signal] = travel.at_mm[i];
        evaluate(std::span<const double>(signals_), std::span<double>(outputs_um_));
        travel.curve_um[i] = outputs_um_[travel.output];
      }
      finish(travel, axis_um);
    }
  }

 private:
  struct Travel {
    AxisSpan span;
    TravelForm form{TravelForm::table};
    std::size_t signal{0};
    std::size_t output{0};
    std::vector<double> at_mm;
    std::vector<double> curve_um;  ///< scratch, shape (at_mm)
  };
  void begin(std::span<const double> signals) noexcept;
  static void finish(const Travel& travel, std::span<double> axis_um) noexcept;

  std::vector<Travel> travels_;
  std::vector<double> signals_;     ///< scratch, shape (signal_columns)
  std::vector<double> outputs_um_;  ///< scratch, shape (outputs)
};

/// Position of a node along its travel: the signal and its value there.
struct NodePlace {
  bool is_node{false};
  std::size_t signal{0};
  double position_mm{0.0};
};
/// One per axis. @throws InvalidValue as TravelCurves
[[nodiscard]] std::vector<NodePlace> node_places(const EstimatorConfig& config,
                                                 const ThermalModel& model);

}  // namespace thermocomp
