/// Mesh of a structure: nodes, elements, parts and named groups; parts made of boxes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "modelling/structure/mesh/element_shape.hpp"

namespace thermocomp::structure {

struct Element {
  Shape shape{};
  Index part{0};
  Index first{0};   ///< index of its nodes in Mesh::connectivity
  Index number{0};  ///< number in the mesh file, for messages
};

/// A face of the surface or of a group of the mesh file.
struct Face {
  Shape shape{};
  Index part{0};
  std::array<Index, 8> nodes{};
};

/// Named nodes of the mesh file and, if given as a surface, faces.
struct Group {
  std::vector<Index> nodes;  ///< increasing
  std::vector<Face> faces;
};

struct Mesh {
  std::vector<Vec3> nodes_m;
  std::vector<Element> elements;
  std::vector<Index> connectivity;
  std::vector<std::string> part_names;
  /// By part: groups of the mesh that the part came from.
  std::vector<std::map<std::string, Group>> groups;

  [[nodiscard]] std::span<const Index> nodes_of(const Element& element) const {
    return {connectivity.data() + element.first, shape_info(element.shape).nodes};
  }
  void add_element(Shape shape, Index part, std::span<const Index> nodes, Index number);
};

/// Coordinates of nodes, shape (nodes of the shape).
using NodeCoordinates = std::array<Vec3, shape_nodes_max>;
[[nodiscard]] NodeCoordinates coordinates_of(const Mesh& mesh, std::span<const Index> nodes);

[[nodiscard]] inline std::span<const Index> nodes_of(const Face& face) {
  return {face.nodes.data(), shape_info(face.shape).nodes};
}

/// Faces of one element only, in the order of the elements.
[[nodiscard]] std::vector<Face> surface_of(const Mesh& mesh);

/// First part of each node; `no_part` if no element has it.
inline constexpr Index no_part = 0xffffffff;
[[nodiscard]] std::vector<Index> parts_of_nodes(const Mesh& mesh);

/// Nodes of the part, including shared ones. Shape (nodes).
[[nodiscard]] std::vector<bool> nodes_of_part(const Mesh& mesh, Index part);

/// Connected body of each node (over shared nodes), from 0; `no_part` if no element has it.
[[nodiscard]] std::vector<Index> bodies_of_nodes(const Mesh& mesh);

/// One line (element, part, place) per inverted or flat element, `count_max` at most.
[[nodiscard]] std::vector<std::string> inverted_elements(const Mesh& mesh, std::size_t count_max);

/// Removes nodes without an element, also from groups, and renumbers the others.
void drop_unused_nodes(Mesh& mesh);

struct Box {
  Vec3 low_m{};
  Vec3 high_m{};
  [[nodiscard]] double diagonal_m() const { return length(high_m - low_m); }
};
[[nodiscard]] Box bounds_of(std::span<const Vec3> points_m);

/// Distance below which two points coincide [m].
[[nodiscard]] double coincidence_m(const Mesh& mesh);

struct BoxShape {
  Box box;
  bool cut{false};  ///< removes material of earlier boxes
};

/// Appends a part. Every face of a box is a plane of the part's grid, so walls, ribs and openings
/// meet in common nodes. A tetrahedral mesh has six elements per cell.
/// @param boxes   in order; where boxes overlap the last one decides
/// @param size_m  largest edges of an element along x, y, z
/// @return the number of elements; 0 if the boxes leave no material
std::size_t add_boxes(Mesh& mesh, Index part, const std::vector<BoxShape>& boxes,
                      const Vec3& size_m, Shape shape);

/// Number of cells that add_boxes() would make, before holes are cut.
[[nodiscard]] double cells_of_boxes(const std::vector<BoxShape>& boxes, const Vec3& size_m);

}  // namespace thermocomp::structure
