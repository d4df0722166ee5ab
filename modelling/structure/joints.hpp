/// Faces of two parts that meet.
#pragma once

#include "modelling/structure/regions.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// Every node of the faces `from` follows the face of `to` that it lies on. Faces that come nowhere
/// nearer than gap_m are a problem, told by the finder.
void tie_faces(RegionFinder& finder, const Mesh& mesh, const JointSpec& joint,
               Reduction& reduction);

/// Couplings between the faces, each as strong as its area [m^2]; problems as above.
[[nodiscard]] std::vector<Coupling> couplings_between(RegionFinder& finder, const Mesh& mesh,
                                                      const JointSpec& joint);

}  // namespace thermocomp::structure
