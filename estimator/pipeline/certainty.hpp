/// Whether the estimates of lost blocks are good enough to compensate by.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"
#include "estimator/sensing/lost_blocks.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Standard deviation that the estimated temperatures give each axis,
///
///     sd = sqrt(g^T V g),   g: slope of the axis' output, V: LostBlocks,
///
/// of a node of a travel with the slide there, against compensation.offset_sd_um_max.
class Certainty {
 public:
  struct State {
    std::vector<double> offset_sd_um;  ///< one per axis; 0 where all is measured
    bool uncertain{false};
  };

  /// @param axis_output  axis -> output of the model
  Certainty(const EstimatorConfig& config, const ThermalModel& model,
            const std::vector<std::size_t>& axis_output);

  /// @return whether each column is measured, or estimated well enough. Without signals or a
  ///         reference nothing is compensated, and nothing new can be said.
  [[nodiscard]] bool step(const LostBlocks& lost, const DisplacementModel& model,
                          const ReferenceState& reference, const Signals& signals) noexcept;
  /// Whether step() would say so, with room for another step: asked before anything is given up.
  [[nodiscard]] bool would_serve(const LostBlocks& lost, const DisplacementModel& model,
                                 const ReferenceState& reference, const Signals& signals) noexcept;
  [[nodiscard]] double offset_sd_um(std::size_t axis) const noexcept {
    return state_.offset_sd_um[axis];
  }

  void adopt(const Certainty& previous) noexcept { state_.uncertain = previous.state_.uncertain; }
  void visit_state(StateArchive& archive) {
    auto& [offset_sd_um, uncertain] = state_;
    archive(offset_sd_um, uncertain);
  }

 private:
  void note_rise(const LostBlocks& lost, const ReferenceState& reference) noexcept;
  /// @pre note_rise()
  [[nodiscard]] double sd_um(std::size_t axis, const LostBlocks& lost,
                             const DisplacementModel& model, const Signals& signals) noexcept;

  const double sd_um_max_;
  const std::vector<std::size_t> axis_output_;
  const std::vector<NodePlace> places_;  ///< one per axis

  State state_;
  std::vector<double> rise_K_;          ///< scratch, one per column
  std::vector<double> slope_um_per_K_;  ///< scratch, one per column
  std::vector<double> signals_;         ///< scratch, of the model
};

}  // namespace thermocomp
