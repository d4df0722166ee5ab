/// Locates points in elements or on faces.
#pragma once

#include <optional>
#include <vector>

#include "modelling/structure/mesh/mesh.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// A point as a weighted sum of nodes (shape functions).
struct PointOnMesh {
  std::vector<Weighted> nodes;
  double distance_m{0.0};  ///< from the requested point
};

/// Nearest point of a part.
/// @return nullopt if the part is further away than `tolerance_m`
[[nodiscard]] std::optional<PointOnMesh> locate_in_part(const Mesh& mesh, Index part,
                                                        const Vec3& point_m, double tolerance_m);

/// Finds the nearest of many faces.
class FaceSearch {
 public:
  FaceSearch(const Mesh& mesh, std::vector<Face> faces);
  [[nodiscard]] std::optional<PointOnMesh> nearest(const Vec3& point_m, double tolerance_m) const;

 private:
  const Mesh& mesh_;
  std::vector<Face> faces_;  ///< sorted by the low end of their box along `axis_`
  std::vector<Box> boxes_;
  std::size_t axis_{0};
  double extent_m_{0.0};  ///< of the longest box along `axis_`
};

}  // namespace thermocomp::structure
