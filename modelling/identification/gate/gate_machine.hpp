/// Two columns and a tie between them: the coefficients of delta = Ki (theta_A - theta_B) - Kc
/// theta_C from dimensions and material (Teratani et al. 1995; beam theory by Castigliano).
#pragma once

namespace thermocomp::identification {

/// Lengths [mm], areas [mm^2], moduli [MPa], expansion [1/K].
struct GateMachine {
  double working_height_mm{0.0};  ///< l, of the working point
  double heated_height_mm{0.0};   ///< l1, of the heated zone
  double tie_height_mm{0.0};      ///< l4
  double column_width_mm{0.0};    ///< h, between the places A and B
  double tie_length_mm{0.0};      ///< lc
  double column_inertia_mm4{0.0};
  double column_modulus_MPa{0.0};
  double column_expansion_per_K{0.0};
  double tie_area_mm2{0.0};
  double tie_modulus_MPa{0.0};
  double tie_expansion_per_K{0.0};
};

struct TieCoefficients {
  double ki_um_per_K{0.0};
  double kc_um_per_K{0.0};
};

/// The publication's three cases, with l4^3 in the last one (printed: l4^2):
///   l4 <= l1       Ki = alpha/(2h) { l1 (2l - l1) - l4 (3l - l4) / q }
///   l1 <= l4 <= l  Ki = alpha/(2h) { l1 (2l - l1) - l1 (3l - l4)(2 l4 - l1) / (l4 q) }
///   l4 >= l        Ki = alpha/(2h) { l1 (2l - l1) - l^2 l1 (3 l4 - l)(2 l4 - l1) / (l4^3 q) }
///   l4 <= l        Kc = (3l - l4) lc alpha_c / (l4 q);  else l^2 (3 l4 - l) lc alpha_c / (l4^3 q)
/// q = km/kc + 2, 1/kc = lc / (Ac Ec), 1/km = l4^3 / (3 E I).
/// @pre all dimensions are positive
[[nodiscard]] TieCoefficients tie_coefficients(const GateMachine& machine);

/// km / kc: stiffness of a column at the tie beside that of the tie.
[[nodiscard]] double stiffness_ratio(const GateMachine& machine);

}  // namespace thermocomp::identification
