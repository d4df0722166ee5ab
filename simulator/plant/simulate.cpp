#include "simulator/plant/simulate.hpp"

#include <cmath>

#include "estimator/checks.hpp"
#include "simulator/plant/plant.hpp"
#include "simulator/plant/seeded_noise.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t indicator_stream = 0x30000;
constexpr double rounding = 1e-9;  // of the number of samples: 3 x 0.1 must reach 0.3

}  // namespace

RunFile simulate(const MachineConfig& machine, double duration_s, std::uint64_t seed) {
  THERMOCOMP_ENSURE(machine.plant.has_value() && duration_s >= 0.0 && machine.pitch_s > 0.0);
  Plant plant(*machine.plant, seed);
  const std::vector<OutputConfig>& outputs = machine.plant->outputs;
  RunFile run;
  run.name = "simulation";
  run.columns = plant.columns();
  const std::size_t first_output = run.columns.size() - outputs.size();
  run.columns.insert(run.columns.begin(), "time_s");
  run.values.resize(run.columns.size());
  const auto samples =
      static_cast<std::uint64_t>(std::floor(duration_s / machine.pitch_s + rounding)) + 1;
  std::vector<double> row(run.columns.size() - 1);
  for (std::uint64_t sample = 0; sample < samples; ++sample) {
    const double time_s = static_cast<double>(sample) * machine.pitch_s;
    plant.advance_to(time_s);
    plant.row(row);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      row[first_output + i] +=
          outputs[i].noise_um * seeded_normal(seed, indicator_stream + i, sample);
    }
    run.values[0].push_back(time_s);
    for (std::size_t i = 0; i < row.size(); ++i) run.values[i + 1].push_back(row[i]);
  }
  run.selected_end = run.rows();
  return run;
}

}  // namespace thermocomp
