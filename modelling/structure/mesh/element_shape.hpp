/// Isoparametric elements: shape functions with derivatives, quadrature rules and faces.
///
/// Order of nodes: corners, then mid-sides, as in Abaqus, CalculiX and VTK. Local coordinates:
/// hexahedra and quadrilaterals in [-1, 1]; simplices r, s, t >= 0 with r + s + t <= 1.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace thermocomp::structure {

using Vec3 = std::array<double, 3>;
using Index = std::uint32_t;  ///< of a node, element or degree of freedom

enum class Shape : std::uint8_t { tet4, tet10, hex8, hex20, tri3, tri6, quad4, quad8 };

constexpr std::size_t shape_nodes_max = 20;

struct ShapeValues {
  std::array<double, shape_nodes_max> n{};    ///< shape functions
  std::array<Vec3, shape_nodes_max> slope{};  ///< derivatives by local coordinates
};

struct RulePoint {
  Vec3 local{};
  double weight{0.0};
  ShapeValues at;
};
using Rule = std::vector<RulePoint>;

struct ShapeFace {
  Shape shape{};
  std::vector<std::uint8_t> nodes;  ///< of the element; outward normal
};

struct ShapeInfo {
  std::string_view name;  ///< "tet10"
  std::size_t dimension{0};
  std::size_t nodes{0};
  std::size_t corners{0};
  std::vector<Vec3> node_locals;
  std::vector<std::array<std::uint8_t, 2>> edges;  ///< corners of each mid-side node
  std::vector<ShapeFace> faces;                    ///< empty for a face
  /// Exact for products of two derivatives in a straight element; used for the stiffness.
  Rule slope_rule;
  /// Exact also for products with shape functions in a straight element.
  Rule product_rule;
};

[[nodiscard]] const ShapeInfo& shape_info(Shape shape);
[[nodiscard]] ShapeValues shape_values(Shape shape, const Vec3& local);
/// Nearest point of the reference element.
[[nodiscard]] Vec3 clamped_local(Shape shape, Vec3 local);

/// Gradients in x, y, z and volume (weight times determinant) at one point of an element.
struct Gradients {
  std::array<Vec3, shape_nodes_max> gradient{};
  double volume{0.0};  ///< zero or negative: inverted here
};
/// @param nodes_m  coordinates of the element's nodes [m], shape (nodes)
[[nodiscard]] Gradients gradients_at(std::span<const Vec3> nodes_m, const RulePoint& point);

/// Normal times area (weight included) of a face at one point [m^2].
[[nodiscard]] Vec3 area_vector_at(std::span<const Vec3> nodes_m, const RulePoint& point);

[[nodiscard]] inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
[[nodiscard]] inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
[[nodiscard]] inline Vec3 operator*(double factor, const Vec3& a) {
  return {factor * a[0], factor * a[1], factor * a[2]};
}
[[nodiscard]] inline double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
[[nodiscard]] inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
[[nodiscard]] double length(const Vec3& a);

}  // namespace thermocomp::structure
