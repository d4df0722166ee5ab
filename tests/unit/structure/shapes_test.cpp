#include <numeric>

#include "models.hpp"

using namespace thermocomp::test;

namespace {

constexpr std::array<Shape, 8> all_shapes{Shape::tet4, Shape::tet10, Shape::hex8,  Shape::hex20,
                                          Shape::tri3, Shape::tri6,  Shape::quad4, Shape::quad8};

/// Integral of r^a s^b t^c over the unit tetrahedron.
double tetrahedron_monomial(int a, int b, int c) {
  return std::tgamma(a + 1) * std::tgamma(b + 1) * std::tgamma(c + 1) / std::tgamma(a + b + c + 4);
}

}  // namespace

TEST_CASE("each shape function is one at its node and zero at the others", "[structure][shape]") {
  for (const Shape shape : all_shapes) {
    const ShapeInfo& info = shape_info(shape);
    INFO(info.name);
    for (std::size_t node = 0; node < info.node_locals.size(); ++node) {
      const ShapeValues values = shape_values(shape, info.node_locals[node]);
      for (std::size_t i = 0; i < info.nodes; ++i) {
        CHECK(near(values.n[i], i == node ? 1.0 : 0.0, 1e-14));
      }
    }
  }
}

TEST_CASE("shape functions add up to one and their slopes are their derivatives",
          "[structure][shape]") {
  const Vec3 local{0.21, 0.34, 0.13};
  constexpr double step = 1e-6;
  for (const Shape shape : all_shapes) {
    const ShapeInfo& info = shape_info(shape);
    INFO(info.name);
    const ShapeValues values = shape_values(shape, local);
    CHECK(near(std::accumulate(values.n.begin(), values.n.end(), 0.0), 1.0, 1e-14));
    for (std::size_t d = 0; d < info.dimension; ++d) {
      Vec3 ahead = local;
      Vec3 behind = local;
      ahead[d] += step;
      behind[d] -= step;
      const ShapeValues after = shape_values(shape, ahead);
      const ShapeValues before = shape_values(shape, behind);
      for (std::size_t i = 0; i < info.nodes; ++i) {
        CHECK(near(values.slope[i][d], (after.n[i] - before.n[i]) / (2 * step), 1e-8));
      }
    }
  }
}

TEST_CASE("the quadrature of a tetrahedron is exact up to the required degree",
          "[structure][shape]") {
  for (const auto& [rule, degree] : {std::pair{&shape_info(Shape::tet10).slope_rule, 2},
                                     std::pair{&shape_info(Shape::tet10).product_rule, 5},
                                     std::pair{&shape_info(Shape::tet4).product_rule, 2}}) {
    for (int a = 0; a <= degree; ++a) {
      for (int b = 0; a + b <= degree; ++b) {
        const int c = degree - a - b;
        double sum = 0.0;
        for (const RulePoint& point : *rule) {
          sum += point.weight * std::pow(point.local[0], a) * std::pow(point.local[1], b) *
                 std::pow(point.local[2], c);
        }
        INFO("degree " << degree << ": " << a << b << c);
        CHECK(near(sum, tetrahedron_monomial(a, b, c), 1e-15));
      }
    }
  }
}

TEST_CASE("face normals point outwards and the faces close the element", "[structure][shape]") {
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    const Mesh mesh = box_mesh({1, 2, 3}, {0.5, 1, 1.5}, shape);
    double volume_m3 = 0.0;  // by the divergence of x / 3
    for (const Face& face : surface_of(mesh)) {
      const auto nodes = nodes_of(face);
      const NodeCoordinates at = coordinates_of(mesh, nodes);
      for (const RulePoint& point : shape_info(face.shape).product_rule) {
        Vec3 place{};
        for (std::size_t i = 0; i < nodes.size(); ++i) {
          place = place + point.at.n[i] * at[i];
        }
        volume_m3 += dot(place, area_vector_at({at.data(), nodes.size()}, point)) / 3.0;
      }
    }
    CHECK(near(volume_m3, 6.0, 1e-12));
    const auto volumes_m3 = nodal_volumes(mesh);
    CHECK(near(std::accumulate(volumes_m3.begin(), volumes_m3.end(), 0.0), 6.0, 1e-12));
    CHECK(inverted_elements(mesh, 5).empty());
  }
}

TEST_CASE("an inverted element is named", "[structure][mesh]") {
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    Mesh mesh = box_mesh({1, 1, 1}, {1, 1, 1}, shape);
    std::swap(mesh.connectivity[1], mesh.connectivity[2]);
    const auto lines = inverted_elements(mesh, 5);
    REQUIRE(lines.size() == 1);
    CHECK(lines[0].find("element 1 (" + std::string(shape_info(shape).name) + ") near") == 0);
    CHECK(lines[0].find("part box") != std::string::npos);
  }
}

TEST_CASE("boxes with a cavity leave it empty", "[structure][mesh]") {
  for (const Shape shape : volume_shapes) {
    Mesh mesh;
    mesh.part_names = {"tube"};
    add_boxes(mesh, 0,
              {{{{0, 0, 0}, {0.6, 0.5, 1.8}}, false}, {{{0.04, 0.04, 0}, {0.56, 0.46, 1.8}}, true}},
              {0.2, 0.2, 0.4}, shape);
    const auto volumes_m3 = nodal_volumes(mesh);
    CHECK(near(std::accumulate(volumes_m3.begin(), volumes_m3.end(), 0.0),
               1.8 * (0.6 * 0.5 - 0.52 * 0.42), 1e-12));
    CHECK(surface_of(mesh).size() > 0);
  }
}
