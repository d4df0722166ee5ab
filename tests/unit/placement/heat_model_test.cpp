// Tests of heat conduction of a structure file: load cases with known results, and refusals.
#include <cmath>
#include <numeric>

#include "machines.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

std::string steady(const std::string& more) {
  return "[[load_case]]\nname = \"steady\"\nsteady = true\n" + more;
}

/// Problems of the file, found with or without the mesh.
std::string problems_of(const std::string& text) {
  try {
    static_cast<void>(problem_of(machine_of(text)));
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("in the steady state all heat leaves by convection", "[placement][heat]") {
  const Machine machine =
      machine_of(column + cooled + heater + steady("signals = { heater_on = 1 }\n"));
  const auto field = fields_of(machine).at(0).rise_K;
  // h times the integral of the rise over the surface: room_W_per_K is h times each node's area.
  const auto& share = machine.heat.room_W_per_K;
  CHECK(std::inner_product(field.begin(), field.end(), share.begin(), 0.0) == Approx(40.0));
  CHECK(std::accumulate(share.begin(), share.end(), 0.0) ==
        Approx(10.0 * (2 * 0.1 * 0.1 + 4 * 0.1 * 0.4)));
}

TEST_CASE("a long load case ends in the steady state", "[placement][heat]") {
  const Machine machine =
      machine_of(column + cooled + heater +
                 "[[load_case]]\nname = \"long\"\nduration_s = 200000\nstep_s = 1000\n"
                 "signals = { heater_on = 1 }\n" +
                 steady("signals = { heater_on = 1 }\n"));
  const auto fields = fields_of(machine);
  REQUIRE(fields.size() == 2);
  for (std::size_t i = 0; i < fields[0].rise_K.size(); ++i) {
    REQUIRE(fields[0].rise_K[i] == Approx(fields[1].rise_K[i]).epsilon(1e-5));
  }
}

TEST_CASE("fields between two steps are interpolated", "[placement][heat]") {
  const auto text = [](const std::string& at_s) {
    return column + cooled + heater +
           "[[load_case]]\nname = \"a\"\nduration_s = 600\nstep_s = 100\nat_s = " + at_s +
           "\nsignals = { heater_on = 1 }\n";
  };
  const auto fields = fields_of(machine_of(text("[200, 250, 300]")));
  for (std::size_t i = 0; i < fields[0].rise_K.size(); ++i) {
    REQUIRE(fields[1].rise_K[i] ==
            Approx(0.5 * (fields[0].rise_K[i] + fields[2].rise_K[i])).margin(1e-12));
  }
}

TEST_CASE("a warmer room warms everything equally; coolant reduces it", "[placement][heat]") {
  const std::string coolant =
      "[coolant]\ntemp_degC = 17\n[[convection]]\non = { part = \"column\" }\n"
      "coefficient_W_per_m2_K = 20\nto = \"coolant\"\n";
  const Machine machine = machine_of(
      column + cooled + coolant + steady("room_change_K = 6\n") +
      "[[load_case]]\nname = \"wet\"\nsteady = true\nroom_change_K = 6\ncoolant_on = true\n");
  const auto fields = fields_of(machine);
  for (const double rise : fields.at(0).rise_K) REQUIRE(rise == Approx(6.0));
  // 10 parts of +6 and 20 parts of -3
  for (const double rise : fields.at(1).rise_K) REQUIRE(rise == Approx(0.0).margin(1e-9));
}

TEST_CASE("heat crosses a joint by its conductance", "[placement][heat]") {
  const auto text = [](const std::string& conductance) {
    return R"(format = 1
[[material]]
name = "iron"
youngs_modulus_GPa = 110
poisson_ratio = 0.25
expansion_um_per_m_K = 10
conductivity_W_per_m_K = 50
density_kg_per_m3 = 7200
heat_capacity_J_per_kg_K = 500
[[part]]
name = "lower"
material = "iron"
size_mm = [100, 100, 50]
[[part.box]]
from_mm = [0, 0, 0]
to_mm = [100, 100, 100]
[[part]]
name = "upper"
material = "iron"
size_mm = [50, 50, 50]
[[part.box]]
from_mm = [0, 0, 100]
to_mm = [100, 100, 200]
[[support]]
on = { z_mm = [0, 0] }
[[joint]]
name = "middle"
from = { part = "upper", z_mm = [100, 100] }
to = { part = "lower", z_mm = [100, 100] }
)" + conductance +
           R"([[block]]
name = "all_degC"
rest = true
[[output]]
name = "z_um"
direction = "z"
tool = { part = "upper", at_mm = [50, 50, 200] }
[[convection]]
on = { part = "lower", z_mm = [0, 0] }
coefficient_W_per_m2_K = 1000
[[heat]]
name = "top"
on = { part = "upper", z_mm = [200, 200] }
heat_W = 10
)" + steady("");
  };
  // 10 W through 0.01 m^2: 1 K at the convection, 2 K per 100 mm of iron, 10 K at the joint.
  const auto top_K = [](const Machine& machine) {
    const auto field = fields_of(machine).at(0).rise_K;
    return *std::max_element(field.begin(), field.end());
  };
  CHECK(top_K(machine_of(text(""))) == Approx(1.0 + 4.0));
  CHECK(top_K(machine_of(text("conductance_W_per_m2_K = 100\n"))) == Approx(1.0 + 4.0 + 10.0));
  CHECK(problems_of(text("conductance_W_per_m2_K = 0\n")).find("no heat can leave this part") !=
        std::string::npos);
}

TEST_CASE("problems of heat and load cases are named", "[placement][bad_input]") {
  struct Case {
    std::string text, reported;
  };
  const std::string good = column + cooled + heater + cases;
  REQUIRE(problems_of(good).empty());
  const auto replaced = [&](const std::string& what, const std::string& with) {
    std::string text = good;
    return text.replace(text.find(what), what.size(), with);
  };
  const std::vector<Case> listed{
      {column + heater + cases, "needs a [[convection]] that carries heat away"},
      {column + cooled + heater, "needs a [[load_case]] that is not left out"},
      {column + cooled + heater + left_out, "needs a [[load_case]] that is not left out"},
      {replaced("conductivity_W_per_m_K = 50\n", ""), "needs conductivity_W_per_m_K"},
      {replaced("density_kg_per_m3 = 7200", "density_kg_per_m3 = nan"), "finite"},
      {replaced("heater_on = 1", "heating_on = 1"), "no [[heat]] has this signal"},
      {replaced("at_s = [600, 1800, 3600]", "at_s = [600, 600]"), "must increase"},
      {replaced("at_s = [600, 1800, 3600]", "at_s = [3601]"), "not be later than duration_s"},
      {replaced("step_s = 120", "step_s = 7200"), "1 to 100000 steps"},
      {replaced("heat_W = 40", "heat_W = inf"), "finite"},
      {replaced("x_mm = [0, 0], z_mm = [200, 400]", "x_mm = [1, 2]"),
       "the region contains no face of the mesh's surface"},
      {replaced("signal = \"heater_on\"", "signal = \"heater_degC\""), "operating signal"},
      {good + "[[convection]]\non = { group = \"skin\" }\ncoefficient_W_per_m2_K = 1\n",
       "there is no group \"skin\""},
      {good + "[placement]\non_the_surface = true\n", "unknown key"},
  };
  for (const auto& [text, reported] : listed) {
    const std::string problems = problems_of(text);
    CAPTURE(reported, problems);
    CHECK(problems.find(reported) != std::string::npos);
    CHECK(problems.find("machine.toml") != std::string::npos);
  }
}
