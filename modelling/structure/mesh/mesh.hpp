/// Nodes, elements, parts and named groups of a structure; parts made of boxes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "modelling/structure/mesh/element_shape.hpp"

namespace thermocomp::structure {

struct Element {
  Shape shape{};
  Index part{0};
  Index first{0};   ///< of its nodes in Mesh::connectivity
  Index number{0};  ///< as the mesh file counts it, for messages
};

/// A face of the surface, or one that a mesh file names in a group.
struct Face {
  Shape shape{};
  Index part{0};
  std::array<Index, 8> nodes{};
};

/// A name of the mesh file for some nodes and, where they were given as a surface, faces.
struct Group {
  std::vector<Index> nodes;  ///< increasing
  std::vector<Face> faces;
};

struct Mesh {
  std::vector<Vec3> nodes_m;
  std::vector<Element> elements;
  std::vector<Index> connectivity;
  std::vector<std::string> part_names;
  /// One map per part: groups are known by the mesh that the part came from.
  std::vector<std::map<std::string, Group>> groups;

  [[nodiscard]] std::span<const Index> nodes_of(const Element& element) const {
    return {connectivity.data() + element.first, shape_info(element.shape).nodes};
  }
  void add_element(Shape shape, Index part, std::span<const Index> nodes, Index number);
};

/// The nodes' coordinates, shape (nodes of the shape).
using NodeCoordinates = std::array<Vec3, shape_nodes_max>;
[[nodiscard]] NodeCoordinates coordinates_of(const Mesh& mesh, std::span<const Index> nodes);

[[nodiscard]] inline std::span<const Index> nodes_of(const Face& face) {
  return {face.nodes.data(), shape_info(face.shape).nodes};
}

/// Faces that belong to one element alone, in the order of the elements.
[[nodiscard]] std::vector<Face> surface_of(const Mesh& mesh);

/// For each node the first part that has it; `no_part` where no element has it.
inline constexpr Index no_part = 0xffffffff;
[[nodiscard]] std::vector<Index> parts_of_nodes(const Mesh& mesh);

/// Whether a node belongs to the part, also where parts share nodes. Shape (nodes).
[[nodiscard]] std::vector<bool> nodes_of_part(const Mesh& mesh, Index part);

/// For each node the connected body it belongs to (over elements that share nodes), counted from
/// 0; `no_part` where no element has it.
[[nodiscard]] std::vector<Index> bodies_of_nodes(const Mesh& mesh);

/// One line for every element that is inverted or flat somewhere, `count_max` at most: element,
/// part and place.
[[nodiscard]] std::vector<std::string> inverted_elements(const Mesh& mesh, std::size_t count_max);

/// Drops nodes that no element uses and renumbers the rest; groups lose those nodes too.
void drop_unused_nodes(Mesh& mesh);

struct Box {
  Vec3 low_m{};
  Vec3 high_m{};
  [[nodiscard]] double diagonal_m() const { return length(high_m - low_m); }
};
[[nodiscard]] Box bounds_of(std::span<const Vec3> points_m);

/// The distance below which two points of the model count as one [m].
[[nodiscard]] double coincidence_m(const Mesh& mesh);

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
