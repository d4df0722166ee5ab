#include "modelling/identification/gate/gate_file.hpp"

#include <initializer_list>
#include <string>

#include <catch2/catch.hpp>

namespace thermocomp::identification {
namespace {

const std::string columns =
    "working_height_mm = 600\nheated_height_mm = 300\n[column]\nwidth_mm = 80\ndepth_mm = 60\n"
    "modulus_MPa = 206000\nexpansion_per_K = 11.5e-6\n";

void refused(const std::string& text, std::initializer_list<const char*> parts) {
  try {
    (void)parse_gate_file(text, "gate.toml");
    FAIL("accepted");
  } catch (const ConfigurationError& error) {
    for (const char* part : parts) CHECK_THAT(error.what(), Catch::Contains(part));
  }
}

TEST_CASE("every fault of a geometry file is named", "[tiebar]") {
  refused(
      "working_height_mm = 100\nheated_height_mm = 200\ntie_height_mm = -1\n[column]\nwidth_mm "
      "= 10\ndepth_mm = 5\ninertia_mm4 = 3\nmodulus_MPa = 1\n[tie]\nlength_mm = 1\ncolour = 2\n",
      {"heated_height_mm", "tie_height_mm", "inertia_mm4", "expansion_per_K", "area_mm2",
       "colour"});
}

TEST_CASE("several ties with faults are reported with file, line, key, value and rule",
          "[tiebar]") {
  refused(columns +
              "[[tie]]\nheight_mm = 0\nlength_mm = 400\narea_mm2 = 150\n"
              "[[tie]]\nheight_mm = 700\nlength_mm = 400\narea_mm2 = 150\n"
              "height_mm_range = [900, 650]\ntemperatures = []\n"
              "[[tie]]\nheight_mm = 700\nlength_mm = 400\narea_mm2 = 150\nfixed = true\n"
              "area_mm2_range = [1, 2]\n",
          {"gate.toml:9", "height_mm = 0", "gate.toml:16", "the lowest and the highest",
           "gate.toml:17", "at least one column", "gate.toml:23", "fixed = true"});
}

TEST_CASE("a single tie height is refused with several ties", "[tiebar]") {
  refused("tie_height_mm = 5\n" + columns +
              "[[tie]]\nheight_mm = 700\nlength_mm = 400\narea_mm2 = 150\n",
          {"tie_height_mm", "[[tie]]"});
}

TEST_CASE("one tie may be written as a table or as a list", "[tiebar]") {
  const std::string tie = "length_mm = 400\narea_mm2 = 150\n";
  const GateFile one = parse_gate_file("tie_height_mm = 700\n" + columns + "[tie]\n" + tie, "a");
  const GateFile list = parse_gate_file(columns + "[[tie]]\nheight_mm = 700\n" + tie, "b");
  REQUIRE(one.columns.ties.size() == 1);
  REQUIRE(list.columns.ties.size() == 1);
  CHECK(tied_coefficients(one.columns).ki_um_per_K == tied_coefficients(list.columns).ki_um_per_K);
  CHECK(one.choices[0].temperatures == list.choices[0].temperatures);
}

TEST_CASE("ranges of the search have defaults, and a fixed tie stays", "[tiebar]") {
  const GateFile file = parse_gate_file(
      columns +
          "[[tie]]\nheight_mm = 250\nlength_mm = 400\narea_mm2 = 150\nfixed = true\n"
          "[[tie]]\nheight_mm = 700\nlength_mm = 400\narea_mm2 = 100\nrise_factor = 0.5\n",
      "gate.toml");
  CHECK(file.choices[0].height_mm.low == file.choices[0].height_mm.high);
  CHECK(file.choices[0].area_mm2.low == 150.0);
  CHECK(file.choices[1].height_mm.low == Approx(120.0));
  CHECK(file.choices[1].height_mm.high == Approx(900.0));
  CHECK(file.choices[1].area_mm2.low == Approx(25.0));
  CHECK(file.choices[1].area_mm2.high == Approx(400.0));
  CHECK(file.choices[1].temperatures == std::vector<std::string>{"tie_2_degC"});
  CHECK(file.side_a == std::vector<std::string>{"side_a_degC"});
}

const std::string heights = "working_height_mm = 600\nheated_height_mm = 300\n";
const std::string steel = "modulus_MPa = 206000\nexpansion_per_K = 11.5e-6\n";
const std::string tie = "[[tie]]\nheight_mm = 250\nlength_mm = 400\narea_mm2 = 150\n";

TEST_CASE("a file without elasticity gives the publication's columns and ties", "[tiebar]") {
  const TiedColumns plain = parse_gate_file(columns + tie, "gate.toml").columns;
  CHECK(plain.column_poisson_ratio == 0.0);
  CHECK(plain.column_shear_compliance_per_N == 0.0);
  CHECK(plain.foot_length_mm == 0.0);
  CHECK(plain.ties[0].thickness_mm == 0.0);
}

TEST_CASE("shear, held feet and bonded ties are read", "[tiebar]") {
  const TiedColumns read = parse_gate_file(columns + "poisson_ratio = 0.3\nfoot = \"held\"\n" +
                                               tie + "thickness_mm = 12.5\n",
                                           "gate.toml")
                               .columns;
  CHECK(read.column_poisson_ratio == 0.3);
  CHECK(read.column_shear_compliance_per_N == Approx(2 * 1.3 / (206000 * 4000.0)));
  CHECK(read.foot_length_mm == Approx(held_foot_length_mm(80, 60, 0.3)));
  CHECK(read.ties[0].thickness_mm == 12.5);
  SECTION("of a column known by its inertia with its shear area") {
    const TiedColumns by_inertia =
        parse_gate_file(heights +
                            "[column]\nwidth_mm = 80\ninertia_mm4 = 2.56e6\nshear_area_mm2 = "
                            "4000\npoisson_ratio = 0.3\n" +
                            steel + tie,
                        "gate.toml")
            .columns;
    CHECK(by_inertia.column_shear_compliance_per_N == Approx(read.column_shear_compliance_per_N));
    CHECK(by_inertia.foot_length_mm == 0.0);
  }
}

TEST_CASE("incomplete elasticity is reported with key and rule", "[tiebar]") {
  refused(columns + "foot = \"held\"\n" + tie, {"column.foot", "needs poisson_ratio"});
  refused(columns + "foot = \"bolted\"\n" + tie, {"column.foot", "bolted"});
  refused(columns + "poisson_ratio = 0.6\n" + tie, {"poisson_ratio = 0.6"});
  refused(columns + "wall_mm = 10\npoisson_ratio = 0.3\nfoot = \"held\"\n" + tie,
          {"column.foot", "without wall_mm"});
  refused(columns + "poisson_ratio = 0.45\nfoot = \"held\"\n" + tie, {"column.foot", "up to 0.4"});
  refused(columns + "shear_area_mm2 = 4000\npoisson_ratio = 0.3\n" + tie,
          {"shear_area_mm2", "where depth_mm is given"});
  refused(columns + tie + "thickness_mm = 12.5\n", {"thickness_mm", "needs poisson_ratio"});
  refused(columns + "poisson_ratio = 0.3\n" + tie + "thickness_mm = 2\n",
          {"thickness_mm", "deeper than the column"});
  const std::string by_inertia =
      heights + "[column]\nwidth_mm = 80\ninertia_mm4 = 2.56e6\n" + steel;
  refused(by_inertia + "poisson_ratio = 0.3\n" + tie, {"poisson_ratio", "shear_area_mm2"});
  refused(by_inertia + "shear_area_mm2 = 4000\n" + tie,
          {"shear_area_mm2", "there is no poisson_ratio"});
}

}  // namespace
}  // namespace thermocomp::identification
