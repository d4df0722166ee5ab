/// A gate-shaped machine as finite elements: one column in plane stress with conduction (quadratic
/// quadrilaterals), the other the same and cold, a tie between them as a rod with pins.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "modelling/identification/gate_machine.hpp"

namespace thermocomp::bench {

/// What the oil does to side A of the column below heated_height, and the air to all the rest.
struct Surroundings {
  double oil_degC{20.0};
  double oil_W_per_m2K{0.0};  ///< 0: the tank is empty
};

class GateFe {
 public:
  /// @param depth_mm  of the column across the plane
  GateFe(const identification::GateMachine& machine, double depth_mm);
  ~GateFe();
  GateFe(const GateFe&) = delete;
  GateFe& operator=(const GateFe&) = delete;

  /// Ki and Kc as finite elements have them: a temperature that is linear across the heated zone.
  [[nodiscard]] identification::TieCoefficients coefficients() const;

  void advance(const Surroundings& around, double seconds);  ///< one implicit step
  [[nodiscard]] double theta_a_K() const;                    ///< side A, middle of the heated zone
  [[nodiscard]] double theta_b_K() const;
  [[nodiscard]] double theta_c_K() const;        ///< mean of the tie
  [[nodiscard]] double displacement_um() const;  ///< positive: tool and work come closer

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::bench
