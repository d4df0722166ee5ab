/// Small structures for tests.
#pragma once

#include <cmath>
#include <functional>

#include <catch2/catch.hpp>

#include "modelling/structure/mesh/mesh.hpp"
#include "modelling/structure/solve/conduction.hpp"
#include "modelling/structure/solve/statics.hpp"

namespace thermocomp::test {

using namespace thermocomp::structure;

inline constexpr std::array<Shape, 4> volume_shapes{Shape::tet4, Shape::tet10, Shape::hex8,
                                                    Shape::hex20};

inline Material steel() {
  return {"steel", 200e9, 0.3, 1.2e-5, 50.0, 7800.0, 460.0};
}

/// Mesh with one part, a box from the origin.
inline Mesh box_mesh(const Vec3& size_m, const Vec3& element_m, Shape shape) {
  Mesh mesh;
  mesh.part_names = {"box"};
  mesh.groups.resize(1);
  add_boxes(mesh, 0, {{{{0, 0, 0}, size_m}, false}}, element_m, shape);
  return mesh;
}

/// Moves every corner by a function of its place, and mid-side nodes to between the moved corners.
inline void distort(Mesh& mesh, const std::function<Vec3(const Vec3&)>& shift) {
  std::vector<Vec3> moved = mesh.nodes_m;
  for (Vec3& node : moved) node = node + shift(node);
  for (const Element& element : mesh.elements) {
    const ShapeInfo& info = shape_info(element.shape);
    const auto nodes = mesh.nodes_of(element);
    for (std::size_t i = info.corners; i < info.nodes; ++i) {
      const auto [a, b] = info.edges[i - info.corners];
      moved[nodes[i]] = 0.5 * (moved[nodes[a]] + moved[nodes[b]]);
    }
  }
  mesh.nodes_m = moved;
}

inline std::vector<Index> nodes_where(const Mesh& mesh,
                                      const std::function<bool(const Vec3&)>& holds) {
  std::vector<Index> found;
  for (Index i = 0; i < mesh.nodes_m.size(); ++i) {
    if (holds(mesh.nodes_m[i])) found.push_back(i);
  }
  return found;
}

inline Index node_at(const Mesh& mesh, const Vec3& place_m) {
  const auto found = nodes_where(mesh, [&](const Vec3& at) { return length(at - place_m) < 1e-9; });
  REQUIRE(found.size() == 1);
  return found[0];
}

/// Couplings of faces to the ground (convection or spring bed), strength per square metre.
inline std::vector<Coupling> ground_couplings(const Mesh& mesh, const std::vector<Face>& faces,
                                              const Vec3& strength_per_m2) {
  std::vector<Coupling> couplings;
  for (const Face& face : faces) {
    const auto nodes = nodes_of(face);
    const NodeCoordinates at = coordinates_of(mesh, nodes);
    for (const RulePoint& point : shape_info(face.shape).product_rule) {
      Coupling coupling;
      coupling.add(nodes, point.at.n, 1.0);
      coupling.strength =
          length(area_vector_at({at.data(), nodes.size()}, point)) * strength_per_m2;
      couplings.push_back(coupling);
    }
  }
  return couplings;
}

inline std::vector<Face> faces_where(const Mesh& mesh,
                                     const std::function<bool(const Vec3&)>& holds) {
  std::vector<Face> found;
  for (const Face& face : surface_of(mesh)) {
    const auto nodes = nodes_of(face);
    if (std::all_of(nodes.begin(), nodes.end(),
                    [&](Index node) { return holds(mesh.nodes_m[node]); })) {
      found.push_back(face);
    }
  }
  return found;
}

inline bool near(double a, double b, double tolerance = 1e-9) {
  return std::fabs(a - b) <= tolerance;
}

}  // namespace thermocomp::test
