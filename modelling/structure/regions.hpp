/// Maps regions of the structure file to a mesh: nodes, faces, couplings, joints.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/elements/matrices.hpp"
#include "modelling/structure/files/structure_spec.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// Finds the nodes and faces of regions; collects problems.
class RegionFinder {
 public:
  /// @pre the mesh must outlive this
  RegionFinder(const Mesh& mesh, std::string file);

  [[nodiscard]] std::vector<Index> nodes_in(const Region& region);
  /// Complete faces of the group, or of the surface.
  [[nodiscard]] std::vector<Face> faces_in(const Region& region);
  [[nodiscard]] const std::vector<Face>& surface() const noexcept { return surface_; }
  [[nodiscard]] double tolerance_m() const noexcept { return tolerance_m_; }

  void problem(const Origin& origin, std::string rule);
  [[nodiscard]] bool has_problems() const noexcept { return !problems_.empty(); }
  /// @throws ConfigurationError if there are problems
  void throw_problems();

 private:
  [[nodiscard]] bool inside(const Region& region, Index node) const;
  [[nodiscard]] Index part_index(const std::string& name) const;
  [[nodiscard]] std::vector<const Group*> groups_of(const Region& region);

  const Mesh& mesh_;
  std::string file_;
  double tolerance_m_;
  std::vector<Face> surface_;
  std::vector<std::vector<bool>> part_has_;
  std::vector<Problem> problems_;
};

/// One coupling per quadrature point of the faces, with its share of the area as strength [m^2].
/// `complete(place_m, coupling)` adds the other side; false: the point is omitted.
template <class Complete>
[[nodiscard]] std::vector<Coupling> couplings_on(const Mesh& mesh, const std::vector<Face>& faces,
                                                 const Complete& complete) {
  std::vector<Coupling> couplings;
  for (const Face& face : faces) {
    const auto nodes = nodes_of(face);
    const NodeCoordinates at = coordinates_of(mesh, nodes);
    for (const RulePoint& point : shape_info(face.shape).product_rule) {
      Coupling coupling;
      coupling.add(nodes, point.at.n, 1.0);
      Vec3 place{};
      for (std::size_t i = 0; i < nodes.size(); ++i) place = place + point.at.n[i] * at[i];
      if (!complete(place, coupling)) continue;
      coupling.strength.fill(length(area_vector_at({at.data(), nodes.size()}, point)));
      couplings.push_back(coupling);
    }
  }
  return couplings;
}

[[nodiscard]] inline std::vector<Coupling> couplings_on(const Mesh& mesh,
                                                        const std::vector<Face>& faces) {
  return couplings_on(mesh, faces, [](const Vec3&, Coupling&) { return true; });
}

/// Ties every node of the faces `from` to the nearest face of `to`. Faces further apart than gap_m
/// everywhere are a problem.
void tie_faces(RegionFinder& finder, const Mesh& mesh, const JointSpec& joint,
               Reduction& reduction);

/// Couplings between the faces, with their area as strength [m^2]; problems as above.
[[nodiscard]] std::vector<Coupling> couplings_between(RegionFinder& finder, const Mesh& mesh,
                                                      const JointSpec& joint);

}  // namespace thermocomp::structure
