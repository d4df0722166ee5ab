#include "cli/model_commands.hpp"

#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "cli/output_file.hpp"
#include "cli/prediction.hpp"
#include "config/model_file.hpp"
#include "config/run_file.hpp"
#include "simulator/machine_file.hpp"
#include "simulator/simulate.hpp"

namespace thermocomp::cli {

namespace {

struct PredictOptions {
  std::string model;
  std::string run;
  std::string output;
};

int run_predict(const PredictOptions& options) {
  const ThermalModel model = load_model(options.model);
  const RunFile run = load_run(parse_selection(options.run));
  const Prediction prediction = predict(model, run);
  if (prediction.time_s.empty()) {
    throw Failure(options.run + ": no row has all inputs of the model and a measured output");
  }
  OutputFile file(options.output);
  file.stream() << write_run(as_run_file(prediction));
  file.commit();
  for (const PredictedOutput& output : prediction.outputs) {
    std::fprintf(stderr, "%s %.3f %.3f\n", output.name.c_str(), output.rms_um, output.peak_um);
  }
  return exit_success;
}

struct SimulateOptions {
  std::string machine;
  std::string output;
  std::optional<std::uint64_t> seed;
};

int run_simulate(const SimulateOptions& options) {
  const MachineConfig machine = load_machine(options.machine);
  if (!machine.plant) throw Failure(options.machine + ": has no plant to simulate");
  if (!(machine.duration_s > 0.0)) {
    throw Failure(options.machine + ": duration_s must be above 0 to make a run file");
  }
  const RunFile run = simulate(machine, machine.duration_s, options.seed.value_or(machine.seed));
  OutputFile file(options.output);
  file.stream() << write_run(run);
  file.commit();
  return exit_success;
}

}  // namespace

void add_model_commands(CLI::App& app, Action& action) {
  const auto predict_options = std::make_shared<PredictOptions>();
  CLI::App* sub = app.add_subcommand("predict", "the model alone over a run file");
  sub->add_option("--model", predict_options->model, "model file")->type_name("FILE")->required();
  sub->add_option("RUN", predict_options->run, "run file, RUN.csv or RUN.csv@T0:T1")
      ->type_name("FILE")
      ->required();
  sub->add_option("-o,--output", predict_options->output, "CSV file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, predict_options] {
    action = [predict_options] { return run_predict(*predict_options); };
  });

  const auto simulate_options = std::make_shared<SimulateOptions>();
  sub = app.add_subcommand("simulate", "a run file of a simulated machine");
  sub->add_option("MACHINE", simulate_options->machine, "file of the simulated machine")
      ->type_name("FILE")
      ->required();
  sub->add_option("-o,--output", simulate_options->output, "run file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->add_option("--seed", simulate_options->seed, "instead of the machine file's own seed");
  sub->callback([&action, simulate_options] {
    action = [simulate_options] { return run_simulate(*simulate_options); };
  });
}

}  // namespace thermocomp::cli
