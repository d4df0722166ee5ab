/// Heat conduction of a structure file: load cases, and reduction to a small state space.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/solve/conduction.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"
#include "simulator/plant/reduced_body.hpp"

namespace thermocomp::structure {

/// Couplings of one film or joint.
struct NamedCouplings {
  std::string name;
  BodyPartKind kind{BodyPartKind::joint};
  std::vector<Coupling> couplings;
};

/// Conduction, convection and heat sources, bound to a structure's mesh.
struct HeatModel {
  Reduction reduction;                  ///< bonded joints
  std::vector<Coupling> dry;            ///< contacts and convection to the room
  std::vector<Coupling> flooded;        ///< `dry` and convection to the coolant
  std::vector<double> room_W_per_K;     ///< heat per kelvin of the room's air, shape (nodes)
  std::vector<double> coolant_W_per_K;  ///< likewise of the coolant
  /// Distribution of each [[heat]] over the nodes, with sum 1. Shape (heats)(nodes).
  std::vector<std::vector<double>> shares;
  std::vector<NamedCouplings> named{};  ///< conducting joints, then convections
};

/// @throws ConfigurationError: regions without faces or nodes, parts without a heat path
[[nodiscard]] HeatModel build_heat_model(const StructureSpec& spec, const Structure& structure);

/// Temperature field of a load case: rise of every node since the start [K].
struct RiseField {
  std::size_t load_case{0};  ///< index in the spec
  double time_s{0.0};
  std::vector<double> rise_K;
};

/// Runs the load cases, each starting at room temperature.
[[nodiscard]] std::vector<RiseField> run_load_cases(const StructureSpec& spec,
                                                    const Structure& structure,
                                                    const HeatModel& heat,
                                                    const Progress& progress);

/// Heat of a source at this value of its signal [W].
[[nodiscard]] double heat_W(const HeatSpec& heat, double signal);

/// A body for the simulator, with the temperature field of each state.
struct BodyReduction {
  ReducedBody body;
  std::vector<std::vector<double>> fields;  ///< shape (states)(nodes)
};

/// Galerkin projection on rational Krylov vectors: V contains the uniform field and (L + s C)^-1 b
/// for every input b (heats, room, coolant) and every output's sensitivity, at several shifts s,
/// without and with coolant; orthonormal in C, then rotated so that V^T L V is diagonal. The
/// response to every input is matched at each shift (exactly in the steady state, s = 0), that of
/// the displacements with its slope. The projection is symmetric, hence stable.
/// Source: E. J. Grimme, Krylov projection methods for model reduction, 1997.
/// @param with_parts  also gives the contributions of each film, joint and part to the matrices
/// @throws ConfigurationError: sensors outside their part, no sensors
[[nodiscard]] BodyReduction reduce_body(const StructureSpec& spec, const Structure& structure,
                                        const HeatModel& heat, const Statics& statics,
                                        bool with_parts = false);

}  // namespace thermocomp::structure
