/// Heat conduction: C dT/dt + L T = q, steady and in time.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "modelling/structure/elements/matrices.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// What drives the temperature at one moment; shapes (nodes).
struct HeatInput {
  std::vector<double> load_W;     ///< sources, and convection's coefficient times room temperature
  std::vector<double> held_degC;  ///< counts where the reduction holds a node
};

class Conduction {
 public:
  /// @pre reduction has one component per node and outlives this
  Conduction(const Mesh& mesh, std::span<const Material> material_of_part,
             const Reduction& reduction, std::span<const Coupling> couplings);

  [[nodiscard]] std::size_t nodes() const noexcept { return reduction_.full_size(); }
  /// L T = q. @throws FactorisationError where nothing fixes the level of the temperature
  [[nodiscard]] std::vector<double> steady_degC(const HeatInput& input) const;
  /// Heat held at `temps_degC` [J], above 0 degC.
  [[nodiscard]] double energy_J(std::span<const double> temps_degC) const;

 private:
  friend class TransientConduction;
  const Reduction& reduction_;
  HeatMatrices full_;
};

/// Steps in time by TR-BDF2: a trapezoidal stage to t + gamma dt, gamma = 2 - sqrt(2), then the
/// backward difference formula through t, t + gamma dt and t + dt. Second order; damps whatever is
/// faster than the step (L-stable), so a source switched on leaves no ringing; both stages share
/// one factor. Held temperatures may vary in time: what their change stores is accounted for.
/// Source: R. E. Bank et al., Transient simulation of silicon devices and circuits, 1985.
class TransientConduction {
 public:
  /// @param initial_degC  shape (nodes)
  TransientConduction(const Conduction& conduction, double step_s,
                      std::span<const double> initial_degC);
  /// One step further. `input_at(time_s, step_middle_s, input)` fills the input of a moment; what
  /// jumps in time takes its value at the step's middle, so that jumps between steps are exact.
  using InputAt = std::function<void(double, double, HeatInput&)>;
  void step(const InputAt& input_at);

  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const std::vector<double>& temps_degC() const noexcept { return temps_degC_; }

 private:
  void solve_stage(std::span<const double> stored, const HeatInput& input, double weight_s);

  const Conduction& conduction_;
  double step_s_;
  double time_s_{0.0};
  long steps_{0};
  std::vector<double> temps_degC_;
  Cholesky factor_;
};

}  // namespace thermocomp::structure
