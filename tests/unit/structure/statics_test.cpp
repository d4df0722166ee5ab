#include <algorithm>

#include "models.hpp"

using namespace thermocomp::test;

namespace {

/// Statically determinate support at three nodes of a corner, in six directions.
Reduction held_at_a_corner(const Mesh& mesh, const Vec3& size_m) {
  Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 3);
  const Index origin = node_at(mesh, {0, 0, 0});
  for (Index c = 0; c < 3; ++c) reduction.hold(origin, c);
  const Index along_x = node_at(mesh, {size_m[0], 0, 0});
  reduction.hold(along_x, 1);
  reduction.hold(along_x, 2);
  reduction.hold(node_at(mesh, {0, size_m[1], 0}), 2);
  reduction.finish();
  return reduction;
}

Vec3 at(const std::vector<double>& u, Index node) {
  return {u[3 * std::size_t{node}], u[3 * std::size_t{node} + 1], u[3 * std::size_t{node} + 2]};
}

/// A smooth shift that is zero on the box' surface.
Vec3 inner_shift(const Vec3& p, const Vec3& size_m) {
  double bump = 0.3;
  for (std::size_t d = 0; d < 3; ++d) bump *= std::sin(M_PI * p[d] / size_m[d]);
  return {bump * 0.2 * size_m[0], -bump * 0.15 * size_m[1], bump * 0.25 * size_m[2]};
}

}  // namespace

TEST_CASE("a free body expands by alpha T L, exactly", "[structure][statics]") {
  const Vec3 size_m{0.4, 0.3, 0.6};
  const std::vector<Material> materials{steel()};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    Mesh mesh = box_mesh(size_m, {0.1, 0.1, 0.15}, shape);
    distort(mesh, [&](const Vec3& p) { return inner_shift(p, size_m); });
    const Reduction reduction = held_at_a_corner(mesh, size_m);
    const Statics statics(mesh, materials, reduction, {});
    const auto u = statics.displacement_m(std::vector<double>(mesh.nodes_m.size(), 7.0));
    double worst = 0.0;
    for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
      worst = std::max(worst, length(at(u, node) - 7.0 * 1.2e-5 * mesh.nodes_m[node]));
    }
    CHECK(worst < 5e-12 * 7.0 * 1.2e-5 * 0.6);
  }
}

TEST_CASE(
    "patch test: distorted elements reproduce a linear displacement prescribed on the boundary",
    "[structure][statics]") {
  const Vec3 size_m{1, 1, 1};
  const std::vector<Material> materials{steel()};
  const auto field = [](const Vec3& p) {
    return Vec3{1e-3 * p[0] + 2e-4 * p[1], -3e-4 * p[0] + 5e-4 * p[2], 4e-4 * p[1] - 6e-4 * p[2]};
  };
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    Mesh mesh = box_mesh(size_m, {0.34, 0.34, 0.34}, shape);
    distort(mesh, [&](const Vec3& p) { return inner_shift(p, size_m); });
    const auto nodes = static_cast<Index>(mesh.nodes_m.size());
    std::vector<bool> outside(nodes, false);
    for (const Face& face : surface_of(mesh)) {
      for (const Index node : nodes_of(face)) outside[node] = true;
    }
    Reduction reduction(nodes, 3);
    std::vector<double> wanted(3 * mesh.nodes_m.size());
    for (Index node = 0; node < nodes; ++node) {
      for (Index c = 0; c < 3; ++c) {
        wanted[3 * node + c] = field(mesh.nodes_m[node])[c];
        if (outside[node]) reduction.hold(node, c);
      }
    }
    reduction.finish();
    REQUIRE(reduction.free_size() > 0);
    const SparseSymmetric full = stiffness_matrix(mesh, materials, {});
    const auto given = reduction.given(wanted);
    std::vector<double> load(given.size());
    full.multiply(given, load);
    for (double& value : load) value = -value;
    std::vector<double> free(reduction.free_size());
    reduction.restrict_to_free(load, free);
    Cholesky(reduction.reduced(full)).solve(free);
    const auto inside = reduction.expanded(free);
    double worst = 0.0;
    for (std::size_t i = 0; i < given.size(); ++i) {
      worst = std::max(worst, std::fabs(inside[i] + given[i] - wanted[i]));
    }
    CHECK(worst < 1e-14);
  }
}

TEST_CASE("patch test: a bar under uniform stress has uniform strain in all elements",
          "[structure][statics]") {
  const Vec3 size_m{0.4, 0.3, 0.6};
  const double stress_Pa = 1e6;
  const std::vector<Material> materials{steel()};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    Mesh mesh = box_mesh(size_m, {0.1, 0.1, 0.15}, shape);
    distort(mesh, [&](const Vec3& p) { return inner_shift(p, size_m); });
    const Reduction reduction = held_at_a_corner(mesh, size_m);
    const Statics statics(mesh, materials, reduction, {});
    std::vector<double> force_N(3 * mesh.nodes_m.size(), 0.0);
    for (const Face& face : surface_of(mesh)) {
      const auto nodes = nodes_of(face);
      const NodeCoordinates place = coordinates_of(mesh, nodes);
      for (const RulePoint& point : shape_info(face.shape).product_rule) {
        const Vec3 area = area_vector_at({place.data(), nodes.size()}, point);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
          force_N[3 * std::size_t{nodes[i]} + 2] += stress_Pa * area[2] * point.at.n[i];
        }
      }
    }
    const auto u = statics.displacement_under_m(force_N);
    for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
      const Vec3& p = mesh.nodes_m[node];
      const double strain = stress_Pa / 200e9;
      const Vec3 wanted{-0.3 * strain * p[0], -0.3 * strain * p[1], strain * p[2]};
      REQUIRE(length(at(u, node) - wanted) < 1e-15);
    }
    const std::vector<double> cold(mesh.nodes_m.size(), 0.0);
    for (const Stress& stress : nodal_stresses_Pa(mesh, materials, u, cold)) {
      REQUIRE(near(stress[2], stress_Pa, 1e-3));
      REQUIRE(near(stress[0], 0.0, 1e-3));
      REQUIRE(near(stress[3], 0.0, 1e-3));
    }
  }
}

TEST_CASE("a bar held at both ends has the compressive stress E alpha T", "[structure][statics]") {
  Material material = steel();
  material.poisson_ratio = 0.0;
  const std::vector<Material> materials{material};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    const Mesh mesh = box_mesh({0.1, 0.1, 1.0}, {0.1, 0.1, 0.25}, shape);
    const auto nodes = static_cast<Index>(mesh.nodes_m.size());
    Reduction reduction(nodes, 3);
    for (Index node = 0; node < nodes; ++node) {
      const Vec3& p = mesh.nodes_m[node];
      if (p[2] == 0.0 || p[2] == 1.0) reduction.hold(node, 2);
    }
    for (Index c = 0; c < 2; ++c) reduction.hold(node_at(mesh, {0, 0, 0}), c);
    reduction.hold(node_at(mesh, {0.1, 0, 0}), 1);
    reduction.finish();
    const Statics statics(mesh, materials, reduction, {});
    const std::vector<double> warm(nodes, 10.0);
    const auto stresses = nodal_stresses_Pa(mesh, materials, statics.displacement_m(warm), warm);
    for (const Stress& stress : stresses) {
      REQUIRE(near(stress[2], -200e9 * 1.2e-5 * 10.0, 1e-2));
    }
  }
}

TEST_CASE("bimetal strip: the cantilever bends as in beam theory", "[structure][statics]") {
  // l = 10, two layers of 0.05, alpha 1e-5 and 2e-5, 100 K, nu = 0: ends at 0.015 and 0.75.
  Mesh mesh;
  mesh.part_names = {"lower", "upper"};
  add_boxes(mesh, 0, {{{{0, 0, 0}, {10, 0.1, 0.1}}, false}}, {0.5, 0.1, 0.05}, Shape::hex20);
  for (Element& element : mesh.elements) {
    const auto nodes = mesh.nodes_of(element);
    const NodeCoordinates place = coordinates_of(mesh, nodes);
    element.part = bounds_of({place.data(), nodes.size()}).low_m[2] > 0.04 ? 1 : 0;
  }
  const Material cold_side{"a", 200e9, 0.0, 1e-5, 50, 7800, 460};
  const Material warm_side{"b", 200e9, 0.0, 2e-5, 50, 7800, 460};
  const std::vector<Material> materials{cold_side, warm_side};
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction reduction(nodes, 3);
  for (const Index node : nodes_where(mesh, [](const Vec3& p) { return p[0] == 0.0; })) {
    reduction.hold(node, 0);
  }
  const Index corner = node_at(mesh, {0, 0, 0.05});
  reduction.hold(corner, 1);
  reduction.hold(corner, 2);
  reduction.hold(node_at(mesh, {0, 0.1, 0.05}), 2);
  reduction.finish();
  const Statics statics(mesh, materials, reduction, {});
  const auto u = statics.displacement_m(std::vector<double>(nodes, 100.0));
  const Vec3 end = at(u, node_at(mesh, {10, 0, 0.05}));
  CHECK(near(end[0], 0.015, 1e-8));
  CHECK(near(end[2], -0.75, 1e-5));  // beam theory ignores the strip's free end
}

TEST_CASE("a warm disc in a thin plate: 50 MPa of hoop stress just outside",
          "[structure][statics]") {
  // Expansion 1e-3 for r < 1 mm in a disc of radius b, E 100 GPa, plane stress: the hoop stress at
  // r just above 1 mm is E 1e-3 / 2 (1 + (1 mm / b)^2).
  constexpr double b_mm = 60.0;
  Mesh mesh;
  mesh.part_names = {"plate", "disc"};
  // Boxes in log(r) and angle over a quarter; the central hole is negligible.
  const double inner = std::log(2e-3);
  const double outer = std::log(b_mm);
  std::vector<BoxShape> rings;
  for (const double end : {0.0, -0.05, 0.05, 0.1, 0.15, 0.2, outer}) {
    rings.push_back({{{inner, 0, 0}, {end, M_PI / 2, 0.01}}, false});
  }
  add_boxes(mesh, 0, rings, {0.15, M_PI / 24, 0.01}, Shape::hex20);
  for (Element& element : mesh.elements) {
    const auto nodes = mesh.nodes_of(element);
    const NodeCoordinates place = coordinates_of(mesh, nodes);
    element.part = bounds_of({place.data(), nodes.size()}).low_m[0] < -1e-9 ? 1 : 0;
  }
  for (Vec3& p : mesh.nodes_m) {
    const double r_m = 1e-3 * std::exp(p[0]);
    p = {r_m * std::cos(p[1]), r_m * std::sin(p[1]), 1e-3 * p[2]};
  }
  REQUIRE(inverted_elements(mesh, 3).empty());
  const std::vector<Material> materials{{"plate", 100e9, 0.3, 0.0, 50, 7800, 460},
                                        {"disc", 100e9, 0.3, 1e-3, 50, 7800, 460}};
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction reduction(nodes, 3);
  for (Index node = 0; node < nodes; ++node) {
    const Vec3& p = mesh.nodes_m[node];
    if (std::fabs(p[0]) < 1e-9) reduction.hold(node, 0);
    if (std::fabs(p[1]) < 1e-9) reduction.hold(node, 1);
    if (p[2] == 0.0) reduction.hold(node, 2);
  }
  reduction.finish();
  const Statics statics(mesh, materials, reduction, {});
  const std::vector<double> one(nodes, 1.0);
  const auto stress = nodal_stresses_Pa(mesh, materials, statics.displacement_m(one), one);
  // Three rings further out, since the disc's thickness affects the plate near the edge.
  const double r_mm = std::exp(0.15);
  const Stress& edge = stress[node_at(mesh, {1e-3 * r_mm, 0, 0})];
  const double near_MPa = 50.0 / (r_mm * r_mm);
  const double far_MPa = 50.0 / (b_mm * b_mm);
  CAPTURE(edge[0], edge[1]);
  CHECK(near(1e-6 * edge[1], near_MPa + far_MPa, 0.5));
  CHECK(near(1e-6 * edge[0], -near_MPa + far_MPa, 0.5));
}

namespace {

/// Point of the section of NAFEMS LE11: 0..1 from the inner to the outer side, 0..3 up through the
/// spherical shell, the taper and the cylinder.
Vec3 le11_section(double across, double up) {
  const double half = std::sqrt(0.5);
  const double outer_turn = std::asin(0.7 / 1.4);  // the outer arc ends at z = 0.7
  const auto inner = [&](double v) -> std::pair<double, double> {
    if (v <= 1.0) return {std::cos(v * M_PI / 4), std::sin(v * M_PI / 4)};
    return {half, v <= 2.0 ? half + (v - 1.0) * (1.2475 - half) : 1.2475 + (v - 2.0) * 0.5425};
  };
  const auto outer = [&](double v) -> std::pair<double, double> {
    if (v <= 1.0) return {1.4 * std::cos(v * outer_turn), 1.4 * std::sin(v * outer_turn)};
    const double end = 1.4 * std::cos(outer_turn);
    if (v <= 2.0) return {end + (v - 1.0) * (1.0 - end), 0.7 + (v - 1.0) * 0.69};
    return {1.0, 1.39 + (v - 2.0) * 0.4};
  };
  const auto [r0, z0] = inner(up);
  const auto [r1, z1] = outer(up);
  return {r0 + across * (r1 - r0), z0 + across * (z1 - z0), 0.0};
}

double le11_stress_MPa(Shape shape, double elements) {
  Mesh mesh;
  mesh.part_names = {"body"};
  const Vec3 size{1.0 / (2 * elements), 1.0 / (3 * elements), M_PI / (12 * elements)};
  add_boxes(mesh, 0,
            {{{{0, 0, 0}, {1, 1, M_PI / 2}}, false},
             {{{0, 1, 0}, {1, 2, M_PI / 2}}, false},
             {{{0, 2, 0}, {1, 3, M_PI / 2}}, false}},
            size, shape);
  std::vector<double> rise_K;
  for (Vec3& p : mesh.nodes_m) {
    const Vec3 section = le11_section(p[0], p[1]);
    p = {section[0] * std::cos(p[2]), section[0] * std::sin(p[2]), section[1]};
    // (up, around, across) is left-handed; (across, up, around) is right-handed.
    p[1] = -p[1];
    rise_K.push_back(std::hypot(p[0], p[1]) + p[2]);
  }
  REQUIRE(inverted_elements(mesh, 3).empty());
  const std::vector<Material> materials{{"body", 210e9, 0.3, 2.3e-4, 50, 7800, 460}};
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction reduction(nodes, 3);
  for (Index node = 0; node < nodes; ++node) {
    const Vec3& p = mesh.nodes_m[node];
    if (std::fabs(p[0]) < 1e-9) reduction.hold(node, 0);
    if (std::fabs(p[1]) < 1e-9) reduction.hold(node, 1);
    if (std::fabs(p[2]) < 1e-9 || near(p[2], 1.79)) reduction.hold(node, 2);
  }
  reduction.finish();
  const Statics statics(mesh, materials, reduction, {});
  const auto stress = nodal_stresses_Pa(mesh, materials, statics.displacement_m(rise_K), rise_K);
  return 1e-6 * stress[node_at(mesh, {1, 0, 0})][2];
}

}  // namespace

TEST_CASE("NAFEMS LE11: -105 MPa at the inner edge, nearer on finer meshes",
          "[structure][statics][fine]") {
  const double coarse = le11_stress_MPa(Shape::hex20, 1);
  const double middle = le11_stress_MPa(Shape::hex20, 2);
  const double fine = le11_stress_MPa(Shape::hex20, 3);
  const double tet_coarse = le11_stress_MPa(Shape::tet10, 1);
  const double tet_fine = le11_stress_MPa(Shape::tet10, 2);
  CAPTURE(coarse, middle, fine, tet_coarse, tet_fine);
  CHECK(near(fine, -105.0, 1.05));
  CHECK(std::fabs(fine + 105.0) < std::fabs(middle + 105.0));
  CHECK(std::fabs(middle + 105.0) < std::fabs(coarse + 105.0));
  const double first_order = std::log((coarse + 105.0) / (middle + 105.0)) / std::log(2.0);
  const double second_order = std::log((middle + 105.0) / (fine + 105.0)) / std::log(1.5);
  CAPTURE(first_order, second_order);
  CHECK(first_order > 1.4);  // the point is on an edge: lower order than for a smooth stress
  CHECK(second_order > 1.8);
  CHECK(near(tet_fine, -105.0, 7.0));
  CHECK(std::fabs(tet_fine + 105.0) < std::fabs(tet_coarse + 105.0));
}

TEST_CASE("a body on springs sinks by the force over their stiffness", "[structure][statics]") {
  const std::vector<Material> materials{steel()};
  const Mesh mesh = box_mesh({0.2, 0.3, 0.1}, {0.1, 0.1, 0.1}, Shape::hex20);
  const auto bottom = faces_where(mesh, [](const Vec3& p) { return p[2] == 0.0; });
  const double area_m2 = 0.2 * 0.3;
  const auto springs = ground_couplings(
      mesh, bottom, {1e6 / area_m2, 2e6 / area_m2, 4e6 / area_m2});  // total N/m: 1, 2, 4 million
  Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 3);
  reduction.finish();
  CHECK(free_motions(mesh, reduction, springs).empty());
  const Statics statics(mesh, materials, reduction, springs);
  // A body force moves it almost without rotation on the springs.
  const auto volumes_m3 = nodal_volumes(mesh);
  std::vector<double> force_N(3 * volumes_m3.size(), 0.0);
  for (std::size_t i = 0; i < volumes_m3.size(); ++i) {
    force_N[3 * i + 2] = -100.0 * volumes_m3[i] / (area_m2 * 0.1);
  }
  const auto u = statics.displacement_under_m(force_N);
  double mean = 0.0;
  for (const Coupling& spring : springs) {
    double down = 0.0;
    for (std::size_t i = 0; i < spring.count; ++i) {
      down += spring.weight[i] * u[3 * std::size_t{spring.nodes[i]} + 2];
    }
    mean += down * spring.strength[2] / 4e6;
  }
  CHECK(near(mean, -100.0 / 4e6, 1e-12));
}

TEST_CASE("adjoint and direct solution give the same sensitivity", "[structure][statics]") {
  const std::vector<Material> materials{steel()};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    const Mesh mesh = box_mesh({0.3, 0.2, 0.6}, {0.1, 0.1, 0.1}, shape);
    Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 3);
    for (const Index node : nodes_where(mesh, [](const Vec3& p) { return p[2] == 0.0; })) {
      for (Index c = 0; c < 3; ++c) reduction.hold(node, c);
    }
    reduction.finish();
    const Statics statics(mesh, materials, reduction, {});
    std::vector<Functional> outputs(2);
    outputs[0].entries = {{node_at(mesh, {0, 0, 0.6}), {1, 0, 0}}};
    outputs[1].entries = {{node_at(mesh, {0.3, 0.2, 0.6}), {0, 0, 1}},
                          {node_at(mesh, {0, 0, 0.3}), {0, -1, 0}}};
    const auto rows = statics.sensitivities(outputs);
    double largest = 0.0;
    double worst = 0.0;
    for (Index node = 0; node < mesh.nodes_m.size(); node += 7) {
      std::vector<double> one(mesh.nodes_m.size(), 0.0);
      one[node] = 1.0;
      const auto u = statics.displacement_m(one);
      for (std::size_t o = 0; o < 2; ++o) {
        largest = std::max(largest, std::fabs(rows[o][node]));
        worst = std::max(worst, std::fabs(rows[o][node] - outputs[o].of(u)));
      }
    }
    CHECK(worst < 1e-11 * largest);
  }
}

TEST_CASE("an unsupported body is named, with its free motion", "[structure][statics]") {
  Mesh mesh = box_mesh({0.2, 0.3, 0.1}, {0.1, 0.1, 0.1}, Shape::tet10);
  mesh.part_names[0] = "table";
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction free(nodes, 3);
  free.finish();
  CHECK(free_motions(mesh, free, {}).size() == 6);
  Reduction slides(nodes, 3);
  for (Index node = 0; node < nodes; ++node) {
    if (mesh.nodes_m[node][2] != 0.0) continue;
    slides.hold(node, 1);
    slides.hold(node, 2);
  }
  slides.finish();
  CHECK(free_motions(mesh, slides, {}) ==
        std::vector<std::string>{"part table is not restrained against moving along x"});
}

TEST_CASE("hexahedra and tetrahedra agree, better on finer meshes", "[structure][statics]") {
  // A column that is warm on one side leans; compares its top along x in hex20 and tet10.
  const std::vector<Material> materials{steel()};
  const auto lean = [&](Shape shape, double size_m) {
    const Mesh mesh = box_mesh({0.2, 0.2, 0.6}, {size_m, size_m, size_m}, shape);
    Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 3);
    std::vector<double> rise_K;
    for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
      const Vec3& p = mesh.nodes_m[node];
      for (Index c = 0; c < 3 && p[2] == 0.0; ++c) reduction.hold(node, c);
      rise_K.push_back(10.0 * std::pow(p[0] / 0.2, 2) * (p[2] / 0.6));
    }
    reduction.finish();
    const Statics statics(mesh, materials, reduction, {});
    return at(statics.displacement_m(rise_K), node_at(mesh, {0, 0, 0.6}))[0];
  };
  const double coarse = std::fabs(lean(Shape::hex20, 0.1) - lean(Shape::tet10, 0.1));
  const double hex = lean(Shape::hex20, 0.05);
  const double fine = std::fabs(hex - lean(Shape::tet10, 0.05));
  CHECK(fine < 0.5 * coarse);
  CHECK(fine < 5e-4 * std::fabs(hex));
}

TEST_CASE("a tied node moves with its masters, also along a chain", "[structure][reduction]") {
  Reduction reduction(5, 1);
  const std::array<Weighted, 2> half{Weighted{0, 0.5}, Weighted{1, 0.5}};
  CHECK(reduction.tie(2, half));
  const std::array<Weighted, 1> third{Weighted{2, 1.0}};
  CHECK(reduction.tie(3, third));
  const std::array<Weighted, 1> back{Weighted{3, 1.0}};
  CHECK_FALSE(reduction.tie(0, back));  // would depend on itself
  CHECK_FALSE(reduction.tie(2, back));  // already tied
  reduction.hold(1, 0);
  reduction.finish();
  CHECK(reduction.free_size() == 2);
  const auto full = reduction.expanded(std::vector<double>{4.0, 9.0});
  CHECK(full == std::vector<double>{4.0, 0.0, 2.0, 2.0, 9.0});
  CHECK(reduction.given(std::vector<double>{0, 10, 0, 0, 0}) ==
        std::vector<double>{0, 10, 5, 5, 0});
}
