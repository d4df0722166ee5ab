// Tests of the machine file's reader and of the files that ship.
#include "simulator/files/machine_file.hpp"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <catch2/catch.hpp>

#include "../temp_folder.hpp"
#include "config/model/model_file.hpp"
#include "estimator/model/displacement_model.hpp"
#include "simulator/plant/plant.hpp"
#include "simulator/plant/simulate.hpp"

using namespace thermocomp;

namespace {

const std::string folder = THERMOCOMP_CONFIG_FOLDER;

const std::string small = R"(format = 1
[plant]
[[signal]]
name = "spindle_rpm"
kind = "steps"
times_s = [0]
values = [1000]
[[output]]
name = "z_um"
[[node]]
name = "spindle"
capacity_J_per_K = 1000
displacement_um_per_K = { z_um = 2.0 }
[[thermocouple]]
name = "spindle"
node = "spindle"
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
[[device]]
name = "module"
bus = "cabinet"
unit = 1
[[channel]]
name = "spindle"
device = "module"
address = 0
[controller]
name = "cnc"
kind = "modbus_tcp"
[[axis]]
name = "z"
output = "z_um"
offset = { address = 0, encoding = "int32", scale = 0.01 }
[[event]]
kind = "drop"
target = "module"
at_s = 1
duration_s = 1
)";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = small;
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

struct Broken {
  std::string from, to, key, rule;
};

}  // namespace

TEST_CASE("the small machine is read completely") {
  const MachineConfig machine = parse_machine(small, "small");
  CHECK(machine.plant->nodes[0].displacement_um_per_K.at("z_um") == 2.0);
  CHECK(machine.devices[0].channels[0].column == "spindle_degC");
  CHECK(machine.controller->axes[0].offset.scale == 0.01);
  CHECK(machine.events[0].target == TargetKind::device);
}

TEST_CASE("a broken machine file is refused with line, key and rule") {
  const auto broken = GENERATE(values<Broken>({
      {"format = 1", "format = 2", "format", ""},
      {"[plant]", "[plant]\nstep_min = 1", "step_min", ""},
      {"values = [1000]", "values = [1000, 2]", "values", "as many numbers"},
      {"times_s = [0]", "times_s = [1]", "times_s", "begin with 0"},
      {"name = \"z_um\"", "name = \"z\"", "name", "_um"},
      {"capacity_J_per_K = 1000", "capacity_J_per_K = 0", "capacity_J_per_K", "must be"},
      {"capacity_J_per_K = 1000", "capacity_J_per_K = \"big\"", "capacity_J_per_K", ""},
      {"{ z_um = 2.0 }", "{ y_um = 2.0 }", "y_um", "output"},
      {"node = \"spindle\"", "node = \"spindel\"", "node", "did you mean \"spindle\""},
      {"unit = 1", "unit = 256", "unit", ""},
      {"unit = 1\n", "", "unit", ""},
      {"bus = \"cabinet\"", "bus = \"cupboard\"", "bus", "must name a bus"},
      {"device = \"module\"", "device = \"modul\"", "device", "did you mean"},
      {"address = 0\n", "address = 65536\n", "address", ""},
      {"name = \"spindle\"\ndevice", "name = \"column\"\ndevice", "name", "column of the plant"},
      {"output = \"z_um\"", "output = \"y_um\"", "output", "column of the plant"},
      {"scale = 0.01", "scale = 0", "scale", "must not be 0"},
      {"kind = \"drop\"", "kind = \"spike\"\nchange_K = 1", "kind", "does not apply"},
      {"kind = \"drop\"", "kind = \"explode\"", "kind", ""},
      {"target = \"module\"", "target = \"nobody\"", "target", "must name"},
      {"duration_s = 1\n", "", "duration_s", ""},
      {"[controller]\nname = \"cnc\"", "[controller]\nname = \"cabinet\"", "name", "twice"},
      {"[[event]]",
       "[[channel]]\nname = \"b\"\ncolumn = \"spindle_degC\"\ndevice = \"module\"\n"
       "address = 0\n[[event]]",
       "address", "shares a register"},
  }));
  const std::string text = replaced(broken.from, broken.to);
  INFO(broken.from << " -> " << broken.to);
  try {
    (void)parse_machine(text, "small");
    FAIL("was accepted");
  } catch (const ConfigurationError& error) {
    bool found = false;
    for (const Problem& problem : error.problems()) {
      INFO(to_string(problem));
      CHECK(problem.line > 0);
      found = found || (problem.key.ends_with(broken.key) &&
                        problem.rule.find(broken.rule) != std::string::npos);
    }
    INFO(error.what());
    CHECK(found);
  }
}

TEST_CASE("a machine without a plant may show columns that only a run file has") {
  const MachineConfig machine = parse_machine(R"(format = 1
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
[[device]]
name = "module"
bus = "cabinet"
unit = 1
[[channel]]
name = "t1"
device = "module"
address = 0
)",
                                              "replay only");
  CHECK_FALSE(machine.plant);
  CHECK(machine.devices[0].channels[0].column == "t1_degC");
}

TEST_CASE("the commented example is valid and contains every kind of event") {
  const MachineConfig machine = load_machine(folder + "/examples/machine.toml");
  for (int kind = 0; kind <= static_cast<int>(MachineEventKind::rehome); ++kind) {
    bool there = false;
    for (const EventConfig& event : machine.events) {
      there = there || event.kind == static_cast<MachineEventKind>(kind);
    }
    CHECK(there);
  }
}

TEST_CASE("block temperatures of the demonstration explain all but 16 % of its displacement") {
  const MachineConfig machine = load_machine(folder + "/demo/machine.toml");
  const ThermalModel model = load_model(folder + "/demo/model.toml");
  const auto seed = GENERATE(20u, 1u, 2u);
  const RunFile run = simulate(machine, machine.duration_s, seed);
  const std::vector<std::vector<std::string>> sensors{{"bed_front_degC", "bed_rear_degC"},
                                                      {"table_degC"},
                                                      {"saddle_degC"},
                                                      {"head_degC"},
                                                      {"spindle_front_degC", "spindle_rear_degC"},
                                                      {"column_left_degC"},
                                                      {"column_right_degC"}};
  const auto block_degC = [&](std::size_t block, std::size_t row) {
    double sum = 0.0;
    for (const std::string& column : sensors[block]) sum += run.column(column)[row];
    return sum / static_cast<double>(sensors[block].size());
  };
  // As in the daemon: with the guideway's rows at the head's position.
  DisplacementModel displacement(model);
  std::vector<double> reference_degC;
  for (std::size_t block = 0; block < sensors.size(); ++block)
    reference_degC.push_back(block_degC(block, 0));
  std::vector<double> temps_degC(sensors.size());
  std::vector<double> predicted_um(model.outputs.size());
  double before = 0.0;
  double after = 0.0;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    for (std::size_t block = 0; block < sensors.size(); ++block)
      temps_degC[block] = block_degC(block, row);
    const std::vector<double> head_mm{run.column("z_mm")[row]};
    displacement.step(nanoseconds{}, temps_degC, reference_degC, head_mm, predicted_um);
    for (std::size_t output = 0; output < model.outputs.size(); ++output) {
      const auto& measured = run.column(model.outputs[output]);
      const double moved_um = measured[row] - measured[0];
      before += moved_um * moved_um;
      after += (moved_um - predicted_um[output]) * (moved_um - predicted_um[output]);
    }
  }
  const auto rows = static_cast<double>(run.rows());
  CHECK(std::sqrt(before / rows) > 20.0);
  CHECK(std::sqrt(before / rows) < 60.0);
  CHECK(std::sqrt(after / before) < 0.16);
}

namespace {

/// Two states; the first is the temperature of the whole body.
const std::string body_text = R"(format = 1
states = 2
conductance = [[10.0, 0.0], [0.0, 40.0]]
coolant_conductance = [[5.0, 1.0], [1.0, 3.0]]
room_inflow = [10.0, 0.0]
coolant_inflow = [5.0, 1.0]
one_degC = [1.0, 0.0]
[[source]]
name = "bearing"
heat_W = 20.0
signal = "spindle_rpm"
at = 1000.0
exponent = 2.0
inflow = [1.0, 2.0]
[[sensor]]
name = "nose"
row = [1.0, 0.5]
[[output]]
name = "z_um"
row = [3.0, -2.0]
)";

/// A machine with its body in a separate file.
std::string machine_text(const std::string& more) {
  return R"(format = 1
[plant]
body = "body.toml"
[[signal]]
name = "spindle_rpm"
kind = "steps"
times_s = [0]
values = [2000]
[[output]]
name = "z_um"
[[thermocouple]]
name = "nose"
node = "nose"
[room]
mean_degC = 20.0
)" + more;
}

std::string problems_of_machine(const std::string& text, const std::string& body) {
  const thermocomp::testing::TempFolder folder_of_body;
  std::ofstream(folder_of_body.path() / "body.toml") << body;
  try {
    static_cast<void>(parse_machine(text, (folder_of_body.path() / "machine.toml").string()));
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a machine with a reduced body warms according to its states") {
  const thermocomp::testing::TempFolder folder_of_body;
  std::ofstream(folder_of_body.path() / "body.toml") << body_text;
  const MachineConfig machine =
      parse_machine(machine_text(""), (folder_of_body.path() / "machine.toml").string());
  Plant plant(*machine.plant, 1);
  CHECK(plant.thermocouple_degC(0) == Approx(20.0));
  CHECK(plant.displacement_um(0) == Approx(0.0).margin(1e-12));
  plant.advance_to(1e4);
  // 20 W (2000/1000)^2 = 80 W: the steady states are 20 + 80/10 and 160/40.
  CHECK(plant.thermocouple_degC(0) == Approx(28.0 + 0.5 * 4.0));
  CHECK(plant.displacement_um(0) == Approx(3.0 * 8.0 - 2.0 * 4.0));
}

TEST_CASE("a body is the same after writing and reading") {
  const ReducedBody body = parse_body(body_text, "body.toml");
  const ReducedBody again = parse_body(write_body(body, "# a body\n"), "again.toml");
  CHECK(again.conductance == body.conductance);
  CHECK(again.coolant_conductance == body.coolant_conductance);
  CHECK(again.sources.at(0).inflow == body.sources.at(0).inflow);
  CHECK(again.sources.at(0).signal == body.sources.at(0).signal);
  CHECK(again.sensors.at(0).row == body.sensors.at(0).row);
  CHECK(again.outputs.at(0).row == body.outputs.at(0).row);
}

TEST_CASE("problems of a body, or of a machine with one, are named") {
  const auto without = [](std::string text, const std::string& what, const std::string& with) {
    return text.replace(text.find(what), what.size(), with);
  };
  CHECK(problems_of_machine(machine_text(""), body_text).empty());
  struct Case {
    std::string machine, body, reported;
  };
  const std::string lump = "[[node]]\nname = \"bed\"\ncapacity_J_per_K = 1.0\n";
  for (const auto& [machine, body, reported] : std::vector<Case>{
           {machine_text(lump), body_text, "must be omitted with plant.body"},
           {without(machine_text(""), "node = \"nose\"", "node = \"nase\""), body_text, "nase"},
           {without(machine_text(""), "z_um", "y_um"), body_text, "the body has no such output"},
           {without(machine_text(""), "spindle_rpm", "drive_rpm"), body_text, "spindle_rpm"},
           {machine_text(""), without(body_text, "[[10.0, 0.0]", "[[10.0, 1.0]"), "symmetric"},
           {machine_text(""), without(body_text, "[1.0, 2.0]", "[1.0]"), "one number per state"},
           {machine_text(""), without(body_text, "20.0", "nan"), "finite"},
           {machine_text(""), without(body_text, "\"z_um\"", "\"z_mm\""), "must end in _um"}}) {
    CAPTURE(reported);
    CHECK(problems_of_machine(machine, body).find(reported) != std::string::npos);
  }
}
