/// The coefficients of the gate machine of config/examples/gate_structure.toml with any number of
/// ties, as finite elements.
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
  /// Refined at the feet and where ties are bonded; Ki and Kc then stay within 0.4 %.
  explicit TiedStructure(const std::vector<FiniteTie>& ties);
  ~TiedStructure();
  TiedStructure(const TiedStructure&) = delete;
  TiedStructure& operator=(const TiedStructure&) = delete;

  /// The same machine to the beams, with all that they can have.
  [[nodiscard]] const identification::TiedColumns& columns() const;
  /// A temperature that is linear across the heated zone, and each tie 1 K warm.
  [[nodiscard]] identification::TiedCoefficients coefficients() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gate_tests
