/// A small column with a heater on one side.
#pragma once

#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "modelling/placement/comparison.hpp"
#include "modelling/structure/heat_model.hpp"

namespace thermocomp::test {

inline const std::string column = R"(format = 1
[[material]]
name = "iron"
youngs_modulus_GPa = 110
poisson_ratio = 0.25
expansion_um_per_m_K = 10
conductivity_W_per_m_K = 50
density_kg_per_m3 = 7200
heat_capacity_J_per_kg_K = 500
[[part]]
name = "column"
material = "iron"
element = "hex20"
size_mm = [50, 50, 100]
[[part.box]]
from_mm = [0, 0, 0]
to_mm = [100, 100, 400]
[[support]]
on = { z_mm = [0, 0] }
[[division]]
part = "column"
x_mm = [50]
z_mm = [200]
names = ["left_low_degC", "right_low_degC", "left_high_degC", "right_high_degC"]
[[output]]
name = "x_um"
direction = "x"
[[output]]
name = "z_um"
direction = "z"
tool = { part = "column", at_mm = [50, 50, 400] }
[[guideway]]
name = "front"
axis = "w_mm"
part = "column"
from_mm = [50, 0, 100]
to_mm = [50, 0, 400]
positions_mm = [0, 100, 200, 300]
carries = "tool"
outputs = { x_um = "x" }
)";

inline const std::string cooled = R"([room]
temp_degC = 20
[[convection]]
on = { part = "column" }
coefficient_W_per_m2_K = 10
)";

inline const std::string heater = R"([[heat]]
name = "heater"
on = { part = "column", x_mm = [0, 0], z_mm = [200, 400] }
heat_W = 40
signal = "heater_on"
)";

inline const std::string cases = R"([[load_case]]
name = "heater"
duration_s = 3600
step_s = 120
at_s = [600, 1800, 3600]
signals = { heater_on = 1 }
[[load_case]]
name = "room"
duration_s = 7200
step_s = 240
room_change_K = 4
)";

inline const std::string left_out = R"([[load_case]]
name = "both"
left_out = true
duration_s = 3600
step_s = 120
signals = { heater_on = 0.5 }
room_change_K = -2
)";

struct Machine {
  structure::StructureSpec spec;
  structure::Structure built;
  structure::HeatModel heat;
};

inline Machine machine_of(const std::string& text) {
  auto spec = structure::parse_structure(text, "machine.toml");
  auto built = structure::build_structure(spec, [](std::string_view) {});
  auto heat = structure::build_heat_model(spec, built);
  return {std::move(spec), std::move(built), std::move(heat)};
}

inline std::vector<structure::RiseField> fields_of(const Machine& machine) {
  return structure::run_load_cases(machine.spec, machine.built, machine.heat,
                                   [](std::string_view) {});
}

inline structure::Statics statics_of(const Machine& machine) {
  return structure::Statics(machine.built.mesh, machine.built.material_of_part,
                            machine.built.reduction, machine.built.springs);
}

inline placement::PlacementProblem problem_of(const Machine& machine) {
  return placement::make_problem(machine.spec, machine.built, statics_of(machine),
                                 fields_of(machine));
}

}  // namespace thermocomp::test
