/// Finite elements of config/examples/gate_structure.toml with any number of ties.
#pragma once

#include <memory>
#include <vector>

#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::gate_tests {

struct FiniteTie {
  double height_mm{0.0};
  double area_mm2{0.0};
};

class TiedStructure {
 public:
  /// Refined at the feet and at bonded ties; Ki and Kc change by at most 0.4 % on further
  /// refinement.
  explicit TiedStructure(const std::vector<FiniteTie>& ties);
  ~TiedStructure();
  TiedStructure(const TiedStructure&) = delete;
  TiedStructure& operator=(const TiedStructure&) = delete;

  /// The same machine as beams, with all elasticity.
  [[nodiscard]] const identification::TiedColumns& columns() const;
  /// From a linear temperature across the heated zone, and 1 K of each tie.
  [[nodiscard]] identification::TiedCoefficients coefficients() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gate_tests
