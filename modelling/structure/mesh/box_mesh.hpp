/// Parts made of boxes: added to each other and cut out of each other, meshed by a grid.
#pragma once

#include <vector>

#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {

struct BoxShape {
  Box box;
  bool cut{false};  ///< takes away what the boxes before it added
};

/// Appends a part. Every face of a box is a plane of the grid through the whole part, so walls,
/// ribs and openings meet in common nodes. A tetrahedral mesh has six elements per cell.
/// @param boxes   in order: where boxes overlap the last one decides
/// @param size_m  an element's greatest edges along x, y, z
/// @return the number of elements; 0 where the boxes leave nothing
std::size_t add_boxes(Mesh& mesh, Index part, const std::vector<BoxShape>& boxes,
                      const Vec3& size_m, Shape shape);

/// How many cells add_boxes() would make, without making them (before holes are cut).
[[nodiscard]] double cells_of_boxes(const std::vector<BoxShape>& boxes, const Vec3& size_m);

}  // namespace thermocomp::structure
