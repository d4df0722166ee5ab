#include <algorithm>
#include <numeric>

#include "models.hpp"

using namespace thermocomp::test;

namespace {

Reduction nothing_held(const Mesh& mesh) {
  Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 1);
  reduction.finish();
  return reduction;
}

HeatInput no_input(const Mesh& mesh) {
  return {std::vector<double>(mesh.nodes_m.size(), 0.0),
          std::vector<double>(mesh.nodes_m.size(), 0.0)};
}

/// NAFEMS T3: bar of 0.1 m, ends at 0 and 100 sin(pi t / 40) degC; 36.60 degC at 0.08 m and 32 s.
double nafems_t3(Shape shape, double element_m, double step_s) {
  const Mesh mesh = box_mesh({0.1, element_m, element_m}, {element_m, element_m, element_m}, shape);
  const std::vector<Material> materials{{"bar", 0, 0, 0, 35.0, 7200.0, 440.5}};
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction reduction(nodes, 1);
  const auto warm_end = nodes_where(mesh, [](const Vec3& p) { return near(p[0], 0.1); });
  for (const Index node : warm_end) reduction.hold(node, 0);
  for (const Index node : nodes_where(mesh, [](const Vec3& p) { return p[0] == 0.0; })) {
    reduction.hold(node, 0);
  }
  reduction.finish();
  const Conduction conduction(mesh, materials, reduction, {});
  TransientConduction transient(conduction, step_s, std::vector<double>(nodes, 0.0));
  const long steps = std::lround(32.0 / step_s);
  for (long i = 0; i < steps; ++i) {
    transient.step([&](double time_s, double, HeatInput& input) {
      for (const Index node : warm_end) {
        input.held_degC[node] = 100.0 * std::sin(M_PI * time_s / 40.0);
      }
    });
  }
  return transient.temps_degC()[node_at(mesh, {0.08, 0, 0})];
}

/// NAFEMS T4: plate of 0.6 x 1.0 m with convection; 18.3 degC (series: 18.2538) at (0.6, 0.2).
double nafems_t4(Shape shape, double element_m) {
  const Mesh mesh = box_mesh({0.6, 1.0, element_m}, {element_m, element_m, element_m}, shape);
  const std::vector<Material> materials{{"plate", 0, 0, 0, 52.0, 7850.0, 460.0}};
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  Reduction reduction(nodes, 1);
  HeatInput input = no_input(mesh);
  for (const Index node : nodes_where(mesh, [](const Vec3& p) { return p[1] == 0.0; })) {
    reduction.hold(node, 0);
    input.held_degC[node] = 100.0;
  }
  reduction.finish();
  const auto open = faces_where(mesh, [](const Vec3& p) { return near(p[0], 0.6); });
  auto faces = faces_where(mesh, [](const Vec3& p) { return near(p[1], 1.0); });
  faces.insert(faces.end(), open.begin(), open.end());
  const auto convection = ground_couplings(mesh, faces, {750.0, 0, 0});
  const Conduction conduction(mesh, materials, reduction, convection);
  return conduction.steady_degC(input)[node_at(mesh, {0.6, 0.2, 0})];
}

}  // namespace

TEST_CASE(
    "patch test: distorted elements reproduce a linear temperature prescribed on the boundary",
    "[structure][conduction]") {
  const std::vector<Material> materials{steel()};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    Mesh mesh = box_mesh({1, 1, 1}, {0.34, 0.34, 0.34}, shape);
    distort(mesh, [](const Vec3& p) {
      const double bump =
          0.06 * std::sin(M_PI * p[0]) * std::sin(M_PI * p[1]) * std::sin(M_PI * p[2]);
      return Vec3{bump, -bump, bump};
    });
    const auto field = [](const Vec3& p) { return 20.0 + 3.0 * p[0] - 7.0 * p[1] + 11.0 * p[2]; };
    Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 1);
    HeatInput input = no_input(mesh);
    for (const Face& face : surface_of(mesh)) {
      for (const Index node : nodes_of(face)) {
        reduction.hold(node, 0);
        input.held_degC[node] = field(mesh.nodes_m[node]);
      }
    }
    reduction.finish();
    const auto temps = Conduction(mesh, materials, reduction, {}).steady_degC(input);
    for (std::size_t i = 0; i < temps.size(); ++i) {
      REQUIRE(near(temps[i], field(mesh.nodes_m[i]), 1e-12));
    }
  }
}

TEST_CASE("NAFEMS T4: temperature of a plate with convection", "[structure][conduction]") {
  // Values of another program on these meshes of 6 x 10, 12 x 20 and 24 x 40 elements.
  CHECK(near(nafems_t4(Shape::hex20, 0.1), 18.794, 1e-3));
  CHECK(near(nafems_t4(Shape::hex20, 0.05), 18.272, 1e-3));
  CHECK(near(nafems_t4(Shape::hex20, 0.025), 18.254, 1e-3));
  CHECK(near(nafems_t4(Shape::tet10, 0.025), 18.2538, 0.01));
  CHECK(near(nafems_t4(Shape::hex8, 0.025), 18.2538, 0.05));
  CHECK(near(nafems_t4(Shape::tet4, 0.025), 18.2538, 0.15));
}

TEST_CASE("steady conduction converges with the order of the elements", "[structure][conduction]") {
  // sin(pi x) sinh(pi y) / sinh(pi) is harmonic; prescribed on the surface, compared inside.
  const std::vector<Material> materials{steel()};
  const auto field = [](const Vec3& p) {
    return std::sin(M_PI * p[0]) * std::sinh(M_PI * p[1]) / std::sinh(M_PI);
  };
  const auto error = [&](Shape shape, double size_m) {
    const Mesh mesh = box_mesh({1, 1, 0.25}, {size_m, size_m, 0.25}, shape);
    Reduction reduction(static_cast<Index>(mesh.nodes_m.size()), 1);
    HeatInput input = no_input(mesh);
    for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
      const Vec3& p = mesh.nodes_m[node];
      if (p[0] > 0 && p[0] < 1 && p[1] > 0 && p[1] < 1) continue;
      reduction.hold(node, 0);
      input.held_degC[node] = field(p);
    }
    reduction.finish();
    const auto temps = Conduction(mesh, materials, reduction, {}).steady_degC(input);
    double squares = 0.0;
    for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
      squares += std::pow(temps[node] - field(mesh.nodes_m[node]), 2);
    }
    return std::sqrt(squares / static_cast<double>(temps.size()));
  };
  for (const auto& [shape, least_order] :
       {std::pair{Shape::tet4, 1.8}, std::pair{Shape::hex8, 1.8}, std::pair{Shape::tet10, 2.7},
        std::pair{Shape::hex20, 2.8}}) {
    const double order = std::log2(error(shape, 0.125) / error(shape, 0.0625));
    INFO(shape_info(shape).name << ": order " << order);
    CHECK(order > least_order);
  }
}

TEST_CASE("NAFEMS T3: temperature in a bar with a varying end, second order in time",
          "[structure][conduction]") {
  CHECK(near(nafems_t3(Shape::hex20, 0.005, 0.1), 36.60, 0.01));
  CHECK(near(nafems_t3(Shape::tet10, 0.005, 0.1), 36.60, 0.03));
  CHECK(near(nafems_t3(Shape::hex8, 0.0025, 0.1), 36.60, 0.06));
  const double exact = nafems_t3(Shape::hex20, 0.01, 0.0625);
  const double coarse = std::fabs(nafems_t3(Shape::hex20, 0.01, 2.0) - exact);
  const double fine = std::fabs(nafems_t3(Shape::hex20, 0.01, 1.0) - exact);
  const double finer = std::fabs(nafems_t3(Shape::hex20, 0.01, 0.5) - exact);
  CAPTURE(exact, coarse, fine, finer);
  CHECK(std::log2(coarse / fine) > 1.7);
  CHECK(std::log2(fine / finer) > 1.8);
}

TEST_CASE("an insulated body stores exactly the heat supplied", "[structure][conduction]") {
  const std::vector<Material> materials{steel()};
  for (const Shape shape : volume_shapes) {
    INFO(shape_info(shape).name);
    const Mesh mesh = box_mesh({0.2, 0.1, 0.1}, {0.1, 0.1, 0.05}, shape);
    const Reduction reduction = nothing_held(mesh);
    const Conduction conduction(mesh, materials, reduction, {});
    const std::vector<double> start(mesh.nodes_m.size(), 20.0);
    TransientConduction transient(conduction, 30.0, start);
    const Index heated = node_at(mesh, {0, 0, 0});
    for (int i = 0; i < 40; ++i) {
      transient.step([&](double, double middle_s, HeatInput& input) {
        input.load_W[heated] = middle_s < 600.0 ? 25.0 : 0.0;
      });
    }
    const double gained_J =
        conduction.energy_J(transient.temps_degC()) - conduction.energy_J(start);
    CHECK(near(gained_J, 25.0 * 600.0, 1e-6));
    CHECK(near(conduction.energy_J(start), 20.0 * 7800 * 460 * 0.2 * 0.1 * 0.1, 1e-6));
  }
}

TEST_CASE("a step far longer than the body's time constants causes no ringing",
          "[structure][conduction]") {
  const std::vector<Material> materials{steel()};
  const Mesh mesh = box_mesh({0.1, 0.1, 0.1}, {0.05, 0.05, 0.05}, Shape::hex20);
  const auto air = ground_couplings(mesh, surface_of(mesh), {2000.0, 0, 0});
  const Reduction reduction = nothing_held(mesh);
  const Conduction conduction(mesh, materials, reduction, air);
  TransientConduction transient(conduction, 1e6, std::vector<double>(mesh.nodes_m.size(), 100.0));
  transient.step([](double, double, HeatInput&) {});
  transient.step([](double, double, HeatInput&) {});
  for (const double temp : transient.temps_degC()) REQUIRE(std::fabs(temp) < 0.01);
}

TEST_CASE("a steady temperature with an undetermined level is refused", "[structure][conduction]") {
  const std::vector<Material> materials{steel()};
  const Mesh mesh = box_mesh({0.1, 0.1, 0.1}, {0.05, 0.05, 0.05}, Shape::hex8);
  const Reduction reduction = nothing_held(mesh);
  const Conduction conduction(mesh, materials, reduction, {});
  HeatInput input = no_input(mesh);
  input.load_W[0] = 1.0;
  CHECK_THROWS_AS(conduction.steady_degC(input), FactorisationError);
}
