// Compares the demonstration's files with the tools' output for its structure.
#include <cmath>
#include <filesystem>

#include "config/model/model_file.hpp"
#include "machines.hpp"
#include "modelling/structure/heat_model.hpp"
#include "simulator/plant/plant.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::filesystem::path demo = std::filesystem::path(THERMOCOMP_CONFIG_FOLDER) / "demo";

Machine demo_machine() {
  auto spec = structure::load_structure(demo / "structure.toml");
  auto built = structure::build_structure(spec, [](std::string_view) {});
  auto heat = structure::build_heat_model(spec, built);
  return {std::move(spec), std::move(built), std::move(heat)};
}

/// A plant of the body with constant signals, room and coolant at 20 degC.
Plant plant_of(const ReducedBody& body, const structure::LoadCaseSpec& load, double head_mm) {
  PlantConfig config;
  config.body = body;
  config.step_s = 30.0;
  config.room.mean_degC = 20.0;
  config.coolant.temp_degC = 20.0;
  for (const BodySource& source : body.sources) {
    const auto found = load.signals.find(*source.signal);
    config.body_signals.push_back(config.signals.size());
    config.signals.push_back({*source.signal,
                              SignalKind::steps,
                              {0.0},
                              {found == load.signals.end() ? 0.0 : found->second}});
  }
  if (load.coolant_on) {
    config.coolant.signal = config.signals.size();
    config.signals.push_back({"coolant_on", SignalKind::steps, {0.0}, {1.0}});
  }
  config.body_axes.assign(body.guideways.size(), config.signals.size());
  config.signals.push_back({"z_mm", SignalKind::steps, {0.0}, {head_mm}});
  for (std::size_t i = 0; i < body.outputs.size(); ++i) {
    config.outputs.push_back({body.outputs[i].name, 0.0});
    config.body_outputs.push_back(i);
  }
  return Plant(config, 1);
}

/// Row of x (0) or y (1) at the guideway's upper end, in the order of the structure's rows.
const structure::Functional& upper_end(const Machine& machine, std::size_t output) {
  const auto& guideway = machine.spec.guideways.at(0);
  const std::size_t positions = guideway.positions_mm.size();
  return machine.built.rows.at(machine.spec.outputs.size() + (output + 1) * positions - 1);
}

}  // namespace

TEST_CASE("the demonstration's matrix is that of its structure", "[demo]") {
  const Machine machine = demo_machine();
  const ThermalModel computed = structure::block_model(
      machine.spec, machine.built, statics_of(machine).sensitivities(machine.built.rows));
  const ThermalModel shipped = load_model(demo / "model.toml");
  CHECK(machine.built.mesh.nodes_m.size() > 2000);
  CHECK(shipped.inputs == computed.inputs);
  CHECK(shipped.outputs == computed.outputs);
  REQUIRE(shipped.matrix_um_per_K.size() == computed.matrix_um_per_K.size());
  for (std::size_t row = 0; row < computed.outputs.size(); ++row) {
    for (std::size_t block = 0; block < computed.inputs.size(); ++block) {
      CHECK(shipped.matrix_um_per_K[row][block] ==
            Approx(computed.matrix_um_per_K[row][block]).margin(0.6e-4));
    }
  }
  REQUIRE(shipped.guideways.size() == 1);
  REQUIRE(computed.guideways.size() == 1);
  CHECK(shipped.guideways[0].axis == computed.guideways[0].axis);
  CHECK(shipped.guideways[0].positions_mm == computed.guideways[0].positions_mm);
  for (const auto& [output, rows] : computed.guideways[0].rows_um_per_K)
    for (std::size_t at = 0; at < rows.size(); ++at)
      for (std::size_t block = 0; block < computed.inputs.size(); ++block)
        CHECK(shipped.guideways[0].rows_um_per_K.at(output)[at][block] ==
              Approx(rows[at][block]).margin(0.6e-4));
}

TEST_CASE("the demonstration's body moves like the full finite-element model", "[demo]") {
  Machine machine = demo_machine();
  // Coolant and room have one temperature, so only the heats act; dry and flooded.
  const ReducedBody shipped = load_body(demo / "plant.toml");
  const structure::Statics statics = statics_of(machine);
  const ReducedBody computed =
      structure::reduce_body(machine.spec, machine.built, machine.heat, statics).body;
  CHECK(shipped.states() == computed.states());
  std::erase_if(machine.spec.load_cases,
                [](const auto& load) { return load.room_change_K != 0.0 && !load.left_out; });
  for (auto& load : machine.spec.load_cases) {
    load.room_change_K = 0.0;
    load.step_s = 60.0;
  }
  for (const structure::RiseField& field : fields_of(machine)) {
    const auto& load = machine.spec.load_cases[field.load_case];
    const auto displacement_m = statics.displacement_m(field.rise_K);
    for (const ReducedBody& body : {shipped, computed}) {
      // At the guideway's upper end, its last row: between rows the full model is not linear.
      for (const double head_mm : {500.0}) {
        Plant plant = plant_of(body, load, head_mm);
        plant.advance_to(field.time_s);
        for (std::size_t i = 0; i < machine.spec.outputs.size(); ++i) {
          CAPTURE(load.name, field.time_s, machine.spec.outputs[i].name, head_mm);
          double expected_m = machine.built.rows[i].of(displacement_m);
          if (head_mm > 250.0 && i < 2) expected_m += upper_end(machine, i).of(displacement_m);
          CHECK(plant.displacement_um(i) == Approx(1e6 * expected_m).margin(0.02));
        }
      }
    }
  }
}
