/// The gate machine of config/examples/gate_structure.toml with the tie at any height: its
/// coefficients, and its course under intermittent oil.
#pragma once

#include <memory>

#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::bench {

/// State of the tank.
struct Oil {
  bool in_tank{true};
  double temp_degC{40.0};
};

class GateStructure {
 public:
  /// @param step_s  time step of advance()
  /// @throws ConfigurationError
  GateStructure(double tie_height_mm, double step_s);
  ~GateStructure();
  GateStructure(const GateStructure&) = delete;
  GateStructure& operator=(const GateStructure&) = delete;

  /// The same machine for the beam formulas.
  [[nodiscard]] const identification::TiedColumns& columns() const;
  /// Ki and Kc by finite elements: a temperature linear across the heated zone, and a tie 1 K warm.
  [[nodiscard]] identification::TiedCoefficients coefficients() const;

  void advance(const Oil& oil);                  ///< one step, initially at room temperature
  [[nodiscard]] double theta_a_K() const;        ///< side A, middle of the heated zone
  [[nodiscard]] double theta_b_K() const;        ///< side B
  [[nodiscard]] double theta_c_K() const;        ///< mean of ten places on the tie
  [[nodiscard]] double displacement_um() const;  ///< positive: tool and work approach

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::bench
