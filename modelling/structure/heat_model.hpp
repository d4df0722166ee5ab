/// Heat conduction of a whole structure, as its file describes it, and its load cases; the same as
/// a small state space for the simulator.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/solve/conduction.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"
#include "simulator/plant/reduced_body.hpp"

namespace thermocomp::structure {

/// The couplings of one film or one joint.
struct NamedCouplings {
  std::string name;
  BodyPartKind kind{BodyPartKind::joint};
  std::vector<Coupling> couplings;
};

/// Everything that conducts and carries heat, bound to a structure's mesh.
struct HeatModel {
  Reduction reduction;                  ///< bonded joints
  std::vector<Coupling> dry;            ///< contacts and convection to the room
  std::vector<Coupling> flooded;        ///< the same and convection to the coolant
  std::vector<double> room_W_per_K;     ///< heat per kelvin of the room's air, shape (nodes)
  std::vector<double> coolant_W_per_K;  ///< the same of the coolant
  /// For each [[heat]] how it spreads over the nodes, adding up to 1. Shape (heats)(nodes).
  std::vector<std::vector<double>> shares;
  std::vector<NamedCouplings> named{};  ///< joints that conduct, then convections
};

/// @throws ConfigurationError: regions without faces or nodes, parts that no heat can leave
[[nodiscard]] HeatModel build_heat_model(const StructureSpec& spec, const Structure& structure);

/// A temperature field of a load case: the rise of every node since the start [K].
struct RiseField {
  std::size_t load_case{0};  ///< in the spec
  double time_s{0.0};
  std::vector<double> rise_K;
};

/// Runs the load cases, each from everything at the temperature of the room.
[[nodiscard]] std::vector<RiseField> run_load_cases(const StructureSpec& spec,
                                                    const Structure& structure,
                                                    const HeatModel& heat,
                                                    const Progress& progress);

/// Heat of a source where its signal has a value [W].
[[nodiscard]] double heat_W(const HeatSpec& heat, double signal);

/// A body for the simulator, with the temperature field that each of its states stands for.
struct BodyReduction {
  ReducedBody body;
  std::vector<std::vector<double>> fields;  ///< shape (states)(nodes)
};

/// Galerkin projection on rational Krylov vectors: V holds the uniform field and
/// (L + s C)^-1 b for every input b (heats, room, coolant) and every output's sensitivity, at some
/// shifts s, without and with coolant; orthonormal in C, then turned so that V^T L V is diagonal.
/// The response to every input is matched at each shift (s = 0: the steady state, exactly), that of
/// the displacements with its slope; symmetric, so stable.
/// Source: E. J. Grimme, Krylov projection methods for model reduction, 1997.
/// @param with_parts  also what each film, joint and part has in the matrices
/// @throws ConfigurationError: sensors outside their part, no sensors
[[nodiscard]] BodyReduction reduce_body(const StructureSpec& spec, const Structure& structure,
                                        const HeatModel& heat, const Statics& statics,
                                        bool with_parts = false);

}  // namespace thermocomp::structure
