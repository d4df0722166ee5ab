/// The gate machine of config/examples/gate_structure.toml with any number of ties, as finite
/// elements: its coefficients, and its course in time under oil that comes and goes.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::gate_tests {

struct FiniteTie {
  double height_mm{0.0};
  double area_mm2{0.0};
};

enum class Elements : std::uint8_t {
  as_in_file,
  refined,  ///< at the feet and where ties are bonded; Ki and Kc then stay within 0.4 %
};

class TiedStructure {
 public:
  /// @param step_s  of advance()
  TiedStructure(const std::vector<FiniteTie>& ties, double step_s,
                Elements elements = Elements::as_in_file);
  ~TiedStructure();
  TiedStructure(const TiedStructure&) = delete;
  TiedStructure& operator=(const TiedStructure&) = delete;

  /// The same machine to the beams, with all that they can have.
  [[nodiscard]] const identification::TiedColumns& columns() const;
  /// A temperature that is linear across the heated zone, and each tie 1 K warm.
  [[nodiscard]] identification::TiedCoefficients coefficients() const;

  void advance(bool oil_in_tank, double oil_degC);
  [[nodiscard]] double theta_a_K() const;                 ///< middle of the heated zone
  [[nodiscard]] double theta_b_K() const;                 ///< opposite
  [[nodiscard]] double theta_c_K(std::size_t tie) const;  ///< mean of the tie's nodes
  [[nodiscard]] double displacement_um() const;           ///< positive: tool and work come closer

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gate_tests
