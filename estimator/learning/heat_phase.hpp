/// Where a machine stands in the course of its heat, read off the model's own displacement.
#pragma once

#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// heating: what the heat source contributes grows; turned: it still grows, but the displacement
/// has come back from its extreme; cooling: it shrinks. A direction has changed when the value has
/// come back by `back_um`, and then since the moment of its extreme. Never allocates, never throws.
/// Source: Teratani et al. 1995, section 5 (the course of the heat tells how the tie has answered).
class HeatPhase {
 public:
  /// @param back_um  larger than what noise moves, > 0
  explicit HeatPhase(double back_um) noexcept : back_um_(back_um) {}

  /// @param heat_um          contribution of the heat source, of either sign
  /// @param displacement_um  of the whole model
  void step(nanoseconds now, double heat_um, double displacement_um) noexcept;
  [[nodiscard]] CoursePhase phase() const noexcept;
  /// Since the heat last came or went [s]; 0 before the first step.
  [[nodiscard]] double since_s() const noexcept;
  /// The next step is the beginning of a heating.
  void restart() noexcept { state_ = {}; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  struct State {
    bool started{false};
    bool heating{true};
    bool turned{false};
    nanoseconds now{};
    nanoseconds changed_at{};
    double heat_extreme_um{0.0};  ///< largest since heating began, least since cooling did
    nanoseconds extreme_at{};
    double began_um{0.0};  ///< displacement when heating began
    double away_um{0.0};   ///< furthest from there
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i] = *this;
      archive(a, b, c, d, e, f, g, h, i);
    }
  };

  double back_um_;
  State state_;
};

}  // namespace thermocomp
