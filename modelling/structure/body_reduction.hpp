/// A structure's heat conduction and thermal displacement as a small state space, for the
/// simulator.
#pragma once

#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "simulator/plant/reduced_body.hpp"

namespace thermocomp::structure {

/// Galerkin projection on rational Krylov vectors: V holds the uniform field and
/// (L + s C)^-1 b for every input b (heats, room, coolant) and every output's sensitivity, at some
/// shifts s, without and with coolant; orthonormal in C, then turned so that V^T L V is diagonal.
/// The response to every input is matched at each shift (s = 0: the steady state, exactly), that of
/// the displacements with its slope; symmetric, so stable.
/// Source: E. J. Grimme, Krylov projection methods for model reduction, 1997.
/// @param with_parts  also what each film, joint and part has in the matrices
/// @throws ConfigurationError: sensors outside their part, no sensors
[[nodiscard]] ReducedBody reduce_body(const StructureSpec& spec, const Structure& structure,
                                      const HeatModel& heat, const Statics& statics,
                                      bool with_parts = false);

}  // namespace thermocomp::structure
