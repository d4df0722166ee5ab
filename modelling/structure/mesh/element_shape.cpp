#include "modelling/structure/mesh/element_shape.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp::structure {
namespace {

// ---------------------------------------------------------------- shape functions

/// Shape functions of a simplex at corners and mid-sides, from barycentric coordinates.
void simplex_values(const ShapeInfo& info, std::span<const double> bary,
                    std::span<const Vec3> bary_slope, ShapeValues& out) {
  if (info.nodes == info.corners) {
    for (std::size_t i = 0; i < info.corners; ++i) {
      out.n[i] = bary[i];
      out.slope[i] = bary_slope[i];
    }
    return;
  }
  for (std::size_t i = 0; i < info.corners; ++i) {
    out.n[i] = bary[i] * (2.0 * bary[i] - 1.0);
    out.slope[i] = (4.0 * bary[i] - 1.0) * bary_slope[i];
  }
  for (std::size_t e = 0; e < info.edges.size(); ++e) {
    const auto [a, b] = info.edges[e];
    out.n[info.corners + e] = 4.0 * bary[a] * bary[b];
    out.slope[info.corners + e] = 4.0 * (bary[a] * bary_slope[b] + bary[b] * bary_slope[a]);
  }
}

struct Factor {
  double value;
  double slope;
};
/// 1 + x x_i, constant where the node's coordinate is 0.
Factor linear(double x, double node) {
  return {1.0 + x * node, node};
}
Factor bubble(double x) {
  return {1.0 - x * x, -2.0 * x};
}

/// Shape functions of a brick or quadrilateral: linear or serendipity.
void brick_values(const ShapeInfo& info, const Vec3& local, ShapeValues& out) {
  const std::size_t dim = info.dimension;
  const double corner_scale = dim == 3 ? 0.125 : 0.25;
  for (std::size_t i = 0; i < info.nodes; ++i) {
    const Vec3& node = info.node_locals[i];
    std::array<Factor, 3> f{Factor{1, 0}, Factor{1, 0}, Factor{1, 0}};
    const bool middle = i >= info.corners;
    double sum = 1.0 - static_cast<double>(dim);
    for (std::size_t d = 0; d < dim; ++d) {
      f[d] = node[d] == 0.0 ? bubble(local[d]) : linear(local[d], node[d]);
      sum += local[d] * node[d];
    }
    const bool quadratic_corner = !middle && info.nodes > info.corners;
    const double scale = middle ? 2.0 * corner_scale : corner_scale;
    const double product = scale * f[0].value * f[1].value * f[2].value;
    out.n[i] = quadratic_corner ? product * sum : product;
    for (std::size_t d = 0; d < dim; ++d) {
      double slope = scale * f[d].slope;
      for (std::size_t o = 0; o < dim; ++o) {
        if (o != d) slope *= f[o].value;
      }
      out.slope[i][d] = quadratic_corner ? slope * sum + product * node[d] : slope;
    }
  }
}

ShapeValues values_of(const ShapeInfo& info, const Vec3& local) {
  ShapeValues out;
  const bool simplex = info.corners == info.dimension + 1;
  if (!simplex) {
    brick_values(info, local, out);
    return out;
  }
  std::array<double, 4> bary{1.0, 0.0, 0.0, 0.0};
  std::array<Vec3, 4> slope{};
  for (std::size_t d = 0; d < info.dimension; ++d) {
    bary[0] -= local[d];
    bary[d + 1] = local[d];
    slope[0][d] = -1.0;
    slope[d + 1][d] = 1.0;
  }
  simplex_values(info, bary, slope, out);
  return out;
}

// ---------------------------------------------------------------- quadrature

struct Point {
  Vec3 local;
  double weight;
};
using Points = std::vector<Point>;

/// Gauss points on [-1, 1] in each dimension.
Points gauss(std::size_t dimension, std::size_t count) {
  const double far = std::sqrt(0.6);
  const double near = std::sqrt(1.0 / 3.0);
  const std::vector<double> at =
      count == 2 ? std::vector<double>{-near, near} : std::vector<double>{-far, 0.0, far};
  const std::vector<double> weight =
      count == 2 ? std::vector<double>{1.0, 1.0} : std::vector<double>{5.0 / 9, 8.0 / 9, 5.0 / 9};
  Points points{{{0, 0, 0}, 1.0}};
  for (std::size_t d = 0; d < dimension; ++d) {
    Points next;
    for (const Point& point : points) {
      for (std::size_t i = 0; i < count; ++i) {
        next.push_back({point.local, point.weight * weight[i]});
        next.back().local[d] = at[i];
      }
    }
    points = std::move(next);
  }
  return points;
}

/// Adds all permutations of the barycentric coordinates (a, a, a, 1 - 3a).
void add_vertex_orbit(Points& points, double a, double weight) {
  const double b = 1.0 - 3.0 * a;
  for (const Vec3& local : {Vec3{a, a, a}, Vec3{b, a, a}, Vec3{a, b, a}, Vec3{a, a, b}}) {
    points.push_back({local, weight});
  }
}

/// Adds all permutations of (a, a, 1/2 - a, 1/2 - a).
void add_edge_orbit(Points& points, double a, double weight) {
  const double b = 0.5 - a;
  for (const Vec3& local :
       {Vec3{a, a, b}, Vec3{a, b, a}, Vec3{b, a, a}, Vec3{b, b, a}, Vec3{b, a, b}, Vec3{a, b, b}}) {
    points.push_back({local, weight});
  }
}

Points tet_centre() {
  return {{{0.25, 0.25, 0.25}, 1.0 / 6}};
}

/// Four points, degree 2.
Points tet_degree_2() {
  Points points;
  add_vertex_orbit(points, (5.0 - std::sqrt(5.0)) / 20.0, 1.0 / 24);
  return points;
}

/// Fourteen points, degree 5, all weights positive. Source: N. J. Walkington, Quadrature on
/// simplices of arbitrary dimension, 2000.
Points tet_degree_5() {
  Points points;
  add_vertex_orbit(points, 0.31088591926330060980, 0.01878132095300264180);
  add_vertex_orbit(points, 0.09273525031089122640, 0.01224884051939365826);
  add_edge_orbit(points, 0.04550370412564964949, 0.00709100346284691107);
  return points;
}

/// Six points, degree 4. Source: D. A. Dunavant, 1985.
Points triangle_degree_4() {
  Points points;
  const auto add = [&points](double a, double weight) {
    const double b = 1.0 - 2.0 * a;
    for (const Vec3& local : {Vec3{a, a, 0}, Vec3{b, a, 0}, Vec3{a, b, 0}}) {
      points.push_back({local, weight});
    }
  };
  add(0.44594849091596488632, 0.11169079483900573285);
  add(0.09157621350977074346, 0.05497587182766093382);
  return points;
}

Rule rule_of(const ShapeInfo& info, const Points& points) {
  Rule rule;
  for (const Point& point : points) {
    rule.push_back({point.local, point.weight, values_of(info, point.local)});
  }
  return rule;
}

// ---------------------------------------------------------------- the table

using Edges = std::vector<std::array<std::uint8_t, 2>>;

const Edges& tet_edges() {
  static const Edges edges{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  return edges;
}
const Edges& hex_edges() {
  static const Edges edges{{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                           {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  return edges;
}

/// Adds faces given by their corners, with mid-side nodes if the shape has them.
void add_faces(ShapeInfo& info, Shape face_shape,
               const std::vector<std::vector<std::uint8_t>>& by) {
  for (const std::vector<std::uint8_t>& corners : by) {
    ShapeFace face{face_shape, corners};
    if (info.nodes > info.corners) {
      for (std::size_t i = 0; i < corners.size(); ++i) {
        const std::uint8_t a = corners[i];
        const std::uint8_t b = corners[(i + 1) % corners.size()];
        const auto edge = std::find_if(info.edges.begin(), info.edges.end(), [&](const auto& e) {
          return (e[0] == a && e[1] == b) || (e[0] == b && e[1] == a);
        });
        face.nodes.push_back(static_cast<std::uint8_t>(info.corners) +
                             static_cast<std::uint8_t>(std::distance(info.edges.begin(), edge)));
      }
    }
    info.faces.push_back(std::move(face));
  }
}

void add_middles(ShapeInfo& info) {
  if (info.nodes == info.corners) return;
  for (const auto& [a, b] : info.edges) {
    info.node_locals.push_back(0.5 * (info.node_locals[a] + info.node_locals[b]));
  }
}

ShapeInfo tetrahedron(bool quadratic) {
  ShapeInfo info;
  info.name = quadratic ? "tet10" : "tet4";
  info.dimension = 3;
  info.nodes = quadratic ? 10 : 4;
  info.corners = 4;
  info.node_locals = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  info.edges = tet_edges();
  add_middles(info);
  add_faces(info, quadratic ? Shape::tri6 : Shape::tri3,
            {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  info.slope_rule = rule_of(info, quadratic ? tet_degree_2() : tet_centre());
  info.product_rule = rule_of(info, quadratic ? tet_degree_5() : tet_degree_2());
  return info;
}

ShapeInfo hexahedron(bool quadratic) {
  ShapeInfo info;
  info.name = quadratic ? "hex20" : "hex8";
  info.dimension = 3;
  info.nodes = quadratic ? 20 : 8;
  info.corners = 8;
  info.node_locals = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                      {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
  info.edges = hex_edges();
  add_middles(info);
  add_faces(info, quadratic ? Shape::quad8 : Shape::quad4,
            {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}});
  info.slope_rule = rule_of(info, gauss(3, quadratic ? 3 : 2));
  info.product_rule = info.slope_rule;
  return info;
}

ShapeInfo triangle(bool quadratic) {
  ShapeInfo info;
  info.name = quadratic ? "tri6" : "tri3";
  info.dimension = 2;
  info.nodes = quadratic ? 6 : 3;
  info.corners = 3;
  info.node_locals = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  info.edges = {{0, 1}, {1, 2}, {2, 0}};
  add_middles(info);
  info.slope_rule = rule_of(info, triangle_degree_4());
  info.product_rule = info.slope_rule;
  return info;
}

ShapeInfo quadrilateral(bool quadratic) {
  ShapeInfo info;
  info.name = quadratic ? "quad8" : "quad4";
  info.dimension = 2;
  info.nodes = quadratic ? 8 : 4;
  info.corners = 4;
  info.node_locals = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  info.edges = {{0, 1}, {1, 2}, {2, 3}, {3, 0}};
  add_middles(info);
  info.slope_rule = rule_of(info, gauss(2, 3));
  info.product_rule = info.slope_rule;
  return info;
}

}  // namespace

const ShapeInfo& shape_info(Shape shape) {
  static const std::array<ShapeInfo, 8> table{
      tetrahedron(false), tetrahedron(true), hexahedron(false),    hexahedron(true),
      triangle(false),    triangle(true),    quadrilateral(false), quadrilateral(true)};
  return table[static_cast<std::size_t>(shape)];
}

ShapeValues shape_values(Shape shape, const Vec3& local) {
  return values_of(shape_info(shape), local);
}

Vec3 clamped_local(Shape shape, Vec3 local) {
  const ShapeInfo& info = shape_info(shape);
  if (info.corners != info.dimension + 1) {
    for (std::size_t d = 0; d < info.dimension; ++d) local[d] = std::clamp(local[d], -1.0, 1.0);
    return local;
  }
  // Projection onto the simplex: clips negative coordinates and spreads the sum's excess,
  // repeatedly.
  for (std::size_t pass = 0; pass < info.dimension; ++pass) {
    double sum = 0.0;
    double positive = 0.0;
    for (std::size_t d = 0; d < info.dimension; ++d) {
      local[d] = std::max(local[d], 0.0);
      sum += local[d];
      if (local[d] > 0.0) positive += 1.0;
    }
    if (sum <= 1.0) return local;
    for (std::size_t d = 0; d < info.dimension; ++d) {
      if (local[d] > 0.0) local[d] -= (sum - 1.0) / positive;
    }
  }
  for (std::size_t d = 0; d < info.dimension; ++d) local[d] = std::clamp(local[d], 0.0, 1.0);
  return local;
}

Gradients gradients_at(std::span<const Vec3> nodes_m, const RulePoint& point) {
  std::array<Vec3, 3> jacobian{};  // row d: derivative of x, y, z by local coordinate d
  for (std::size_t i = 0; i < nodes_m.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      jacobian[d] = jacobian[d] + point.at.slope[i][d] * nodes_m[i];
    }
  }
  const std::array<Vec3, 3> cofactor{cross(jacobian[1], jacobian[2]),
                                     cross(jacobian[2], jacobian[0]),
                                     cross(jacobian[0], jacobian[1])};
  const double determinant = dot(jacobian[0], cofactor[0]);
  Gradients out;
  out.volume = point.weight * determinant;
  for (std::size_t i = 0; i < nodes_m.size(); ++i) {
    const Vec3& slope = point.at.slope[i];
    out.gradient[i] = (1.0 / determinant) *
                      (slope[0] * cofactor[0] + slope[1] * cofactor[1] + slope[2] * cofactor[2]);
  }
  return out;
}

Vec3 area_vector_at(std::span<const Vec3> nodes_m, const RulePoint& point) {
  Vec3 along{};
  Vec3 across{};
  for (std::size_t i = 0; i < nodes_m.size(); ++i) {
    along = along + point.at.slope[i][0] * nodes_m[i];
    across = across + point.at.slope[i][1] * nodes_m[i];
  }
  return point.weight * cross(along, across);
}

double length(const Vec3& a) {
  return std::sqrt(dot(a, a));
}

}  // namespace thermocomp::structure
