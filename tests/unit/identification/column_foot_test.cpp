#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <catch2/catch.hpp>

#include "modelling/identification/gate/tied_columns.hpp"
#include "modelling/identification/printed.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"

namespace thermocomp::gate_tests {
namespace {

using namespace thermocomp::structure;

constexpr double width_mm = 80.0;
constexpr double height_mm = 400.0;
constexpr double lower_mm = 190.0;
constexpr double upper_mm = 380.0;
constexpr double finest_mm = 2.0;
constexpr double growth = 1.6;
constexpr double modulus_MPa = 206000.0;
constexpr double expansion_per_K = 11.5e-6;

/// A column whose foot is clamped in all directions, with small elements at the foot and its edges.
StructureSpec clamped_column(double depth_mm, double poisson_ratio) {
  using identification::printed;
  const auto box = [](double x_mm, double y_mm, double z_mm) {
    return printed("[[part.box]]\nfrom_mm = [0, 0, 0]\nto_mm = [%f, %f, %f]\n", x_mm, y_mm, z_mm);
  };
  std::string text = printed(
      "format = 1\n[[material]]\nname = \"steel\"\nyoungs_modulus_GPa = 206.0\n"
      "poisson_ratio = %f\nexpansion_um_per_m_K = 11.5\nconductivity_W_per_m_K = 50.0\n"
      "density_kg_per_m3 = 7800.0\nheat_capacity_J_per_kg_K = 460.0\n"
      "[[part]]\nname = \"column\"\nmaterial = \"steel\"\nsize_mm = [20, 20, 20]\n",
      poisson_ratio);
  text += box(width_mm, depth_mm, height_mm);
  double at_mm = finest_mm;
  for (double size_mm = finest_mm; at_mm < width_mm / 2; size_mm *= growth, at_mm += size_mm) {
    text += box(width_mm, depth_mm, at_mm) + box(at_mm, depth_mm, height_mm) +
            box(width_mm - at_mm, depth_mm, height_mm);
    if (at_mm < depth_mm / 2 - finest_mm)
      text += box(width_mm, at_mm, height_mm) + box(width_mm, depth_mm - at_mm, height_mm);
  }
  text += "[[support]]\non = { z_mm = [0, 0] }\n[[block]]\nname = \"all_degC\"\nrest = true\n";
  for (const double z_mm : {lower_mm, upper_mm})
    text += printed(
        "[[output]]\nname = \"x_%.0f_um\"\ndirection = \"x\"\n"
        "tool = { part = \"column\", at_mm = [%f, %f, %f] }\n",
        z_mm, width_mm / 2, depth_mm / 2, z_mm);
  return parse_structure(text, "clamped_column.toml");
}

TEST_CASE("a foot held crosswise agrees with finite elements of a clamped column",
          "[tiebar][fe][foot]") {
  const double poisson_ratio = GENERATE(0.0, 0.3);
  const double depth_mm = GENERATE(20.0, 60.0, 160.0);
  const StructureSpec spec = clamped_column(depth_mm, poisson_ratio);
  const Structure structure = build_structure(spec, [](std::string_view) {});
  const Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                        structure.springs);
  identification::ColumnBeam beam;
  beam.bending_stiffness_Nmm2 = modulus_MPa * depth_mm * width_mm * width_mm * width_mm / 12;
  beam.shear_compliance_per_N =
      2 * (1 + poisson_ratio) /
      (modulus_MPa * identification::rectangle_shear_area_mm2(width_mm, depth_mm, depth_mm));
  beam.poisson_ratio = poisson_ratio;
  beam.foot_length_mm = identification::held_foot_length_mm(width_mm, depth_mm, poisson_ratio);
  beam.curvature_per_mm_K = expansion_per_K / width_mm;
  beam.heated_height_mm = height_mm;

  std::vector<double> rise_K;
  for (const Vec3& node_m : structure.mesh.nodes_m)
    rise_K.push_back(0.5 - 1e3 * node_m[0] / width_mm);
  const auto warm_m = statics.displacement_m(rise_K);
  const double tilt_mm = 1e3 * (structure.rows[1].of(warm_m) - structure.rows[0].of(warm_m)) -
                         beam.curvature_per_mm_K * (upper_mm * upper_mm - lower_mm * lower_mm) / 2;
  const double foot_mm = tilt_mm / (upper_mm - lower_mm) / beam.curvature_per_mm_K;
  CAPTURE(poisson_ratio, depth_mm, foot_mm, beam.foot_length_mm);
  if (poisson_ratio > 0.0)
    CHECK(beam.foot_length_mm == Approx(foot_mm).epsilon(0.06));
  else
    CHECK(std::abs(foot_mm) < 0.002 * width_mm);

  std::vector<double> force_N(3 * structure.mesh.nodes_m.size(), 0.0);
  for (const Functional::Entry& entry : structure.rows[1].entries)
    force_N[3 * std::size_t{entry.node}] += entry.weight[0];
  const double yielding_mm = 1e3 * structure.rows[0].of(statics.displacement_under_m(force_N));
  // A column twice as deep as wide bends partly like a plate.
  const double near = depth_mm > width_mm ? 0.015 : 0.005;
  CHECK(beam.deflection_mm_per_N(lower_mm, upper_mm) == Approx(yielding_mm).epsilon(near));
}

}  // namespace
}  // namespace thermocomp::gate_tests
