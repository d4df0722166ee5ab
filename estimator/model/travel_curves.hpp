/// The displacement along the travel of axes whose controller interpolates by itself, and what it
/// is at the nodes that the controller gets.
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
  double at_first{0.0};   ///< value at the first point
  double at_last{0.0};    ///< value at the last point
  double deviation{0.0};  ///< largest |y_i - line(x_i)|
};

/// The line whose largest deviation from the points is the least possible: it passes between three
/// of them at equal distances, on alternating sides, and no other point lies further off.
/// @param x  strictly increasing, two points at least
/// @param y  shape (x)
/// Never throws, never allocates. A value that is no number gives a line that is none.
/// Source: E. Ya. Remez, exchange algorithm for a polynomial of the first degree on a finite set.
[[nodiscard]] CurveLine minimax_line(std::span<const double> x, std::span<const double> y) noexcept;

/// Where the curve of an output along a position is looked at: its kinks (positions of guideways)
/// and `even` places from end to end, both ends among them; increasing.
[[nodiscard]] std::vector<double> travel_samples_mm(const ThermalModel& model,
                                                    const std::string& position, double low_mm,
                                                    double high_mm, std::size_t even);

/// At each node of a table the curve itself; at both ends of a line the straight line whose largest
/// deviation from the curve is the least possible.
class TravelCurves {
 public:
  /// @throws InvalidValue for a position that is no signal of the model or nodes out of order
  TravelCurves(const EstimatorConfig& config, const ThermalModel& model);

  [[nodiscard]] bool empty() const noexcept { return travels_.empty(); }

  /// @param evaluate  (signals, displacement_um of the outputs): the model at this moment with the
  ///                  slides at these positions; must not move on by being asked
  /// @param signals   shape (signal_columns), of the moment
  /// @param axis_um   one an axis; of nodes overwritten, the others are left as they are
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

/// Where an axis' entry stands for a place: the signal that says so, and its value there.
struct NodePlace {
  bool is_node{false};
  std::size_t signal{0};
  double position_mm{0.0};
};
/// One an axis. @throws InvalidValue as TravelCurves
[[nodiscard]] std::vector<NodePlace> node_places(const EstimatorConfig& config,
                                                 const ThermalModel& model);

}  // namespace thermocomp
