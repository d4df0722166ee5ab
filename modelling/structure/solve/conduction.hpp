/// Heat conduction: C dT/dt + L T = q, steady and in time.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "modelling/structure/elements/matrices.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// Heat inputs at one time; shapes (nodes).
struct HeatInput {
  std::vector<double> load_W;     ///< sources, and convection coefficient times room temperature
  std::vector<double> held_degC;  ///< used for nodes held by the reduction
};

class Conduction {
 public:
  /// @pre reduction has one component per node and outlives this
  Conduction(const Mesh& mesh, std::span<const Material> material_of_part,
             const Reduction& reduction, std::span<const Coupling> couplings);

  [[nodiscard]] std::size_t nodes() const noexcept { return reduction_.full_size(); }
  /// Solves L T = q. @throws FactorisationError if the level of the temperature is undetermined
  [[nodiscard]] std::vector<double> steady_degC(const HeatInput& input) const;
  /// Stored heat at `temps_degC` relative to 0 degC [J].
  [[nodiscard]] double energy_J(std::span<const double> temps_degC) const;

 private:
  friend class TransientConduction;
  const Reduction& reduction_;
  HeatMatrices full_;
};

/// Time integration by TR-BDF2: a trapezoidal stage to t + gamma dt, gamma = 2 - sqrt(2), then the
/// backward difference formula through t, t + gamma dt and t + dt. Second order and L-stable, so a
/// source that switches on causes no ringing; both stages share one factor. The heat stored by
/// varying held temperatures is included.
/// Source: R. E. Bank et al., Transient simulation of silicon devices and circuits, 1985.
class TransientConduction {
 public:
  /// @param initial_degC  shape (nodes)
  TransientConduction(const Conduction& conduction, double step_s,
                      std::span<const double> initial_degC);
  /// Advances one step. `input_at(time_s, step_middle_s, input)` fills in the input at a time;
  /// discontinuous inputs are taken at the step's middle, which makes jumps between steps exact.
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
