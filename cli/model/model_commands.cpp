#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "cli/model/course_fit.hpp"
#include "cli/model/covariance_fit.hpp"
#include "cli/model/prediction.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "config/runs/run_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "daemon/history/replay/record_loader.hpp"
#include "report/files.hpp"
#include "simulator/files/machine_file.hpp"
#include "simulator/plant/simulate.hpp"

namespace thermocomp::cli {

namespace {

struct PredictOptions {
  std::string model;
  std::string run;
  std::string columns;
  std::string output;
};

int run_predict(const PredictOptions& options) {
  const ThermalModel model = load_model(options.model);
  const RunFile run = RunLoader(options.columns).load(options.run);
  const Prediction prediction = predict(model, run);
  if (prediction.time_s.empty()) {
    throw Failure(options.run + ": no row has all inputs of the model and a measured output");
  }
  cli::write_file(options.output, write_run(as_run_file(prediction)));
  for (const PredictedOutput& output : prediction.outputs) {
    std::fprintf(stderr, "%s %.3f %.3f\n", output.name.c_str(), output.rms_um, output.peak_um);
    if (!output.measured_there)
      std::fprintf(stderr, "%s: %s has no measured value to compare with\n", output.name.c_str(),
                   run.name.c_str());
  }
  const std::string furthest = furthest_text(prediction);
  if (!furthest.empty()) std::fprintf(stderr, "%s\n", furthest.c_str());
  if (model.made_from) std::fprintf(stderr, "outside %.3f\n", outside_share(prediction));
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
    throw Failure(options.machine + ": duration_h must be above 0 to make a run file");
  }
  const RunFile run = simulate(machine, machine.duration_s, options.seed.value_or(machine.seed));
  cli::write_file(options.output, write_run(run));
  return exit_success;
}

struct CovarianceOptions {
  std::string model;
  std::vector<std::string> records;
  std::string columns;
  std::string output;
};

int run_covariance(const CovarianceOptions& options) {
  const std::string text = read_text_file(options.model, model_bytes_max);
  ThermalModel model = parse_model(text, options.model);
  if (model.inputs.size() > covariance_inputs_max) {
    throw Failure(options.model + ": a covariance supports at most " +
                  std::to_string(covariance_inputs_max) + " inputs");
  }
  std::vector<RunFile> runs;
  RunLoader loader(options.columns);
  for (const std::string& record : options.records) runs.push_back(load_record(record, loader));
  const CovarianceFit fit = fit_covariance(runs, model.inputs);
  model.covariance_K2 = fit.matrix_K2;
  model.covariance_growth = fit.growth;
  cli::write_file(options.output, with_covariance(text, model));
  std::fprintf(stderr, "%zu rows, %.1f h; an input lost alone, after an hour (1 sd):\n", fit.rows,
               fit.hours);
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    std::fprintf(stderr, "%s %.3f K\n", model.inputs[i].c_str(), fit.sd_1h_K[i]);
  }
  return exit_success;
}

struct CourseOptions {
  std::string config;
  std::vector<std::string> records;
  std::string columns;
  std::string output;
  double every_s{60.0};
};

int run_correction(const CourseOptions& options) {
  const DaemonConfig config = load_daemon_config(options.config);
  const CorrectionConfig& correction = config.estimator.correction;
  if (correction.form == CorrectionForm::off) {
    throw Failure(options.config + ": [correction] form is \"off\"; choose \"two_phase\" or " +
                  "\"recursive\" and its groups, since the record contains their gains");
  }
  ThermalModel model = load_model(config.model_file);
  std::vector<RunFile> runs;
  RunLoader loader(options.columns);
  for (const std::string& record : options.records) {
    std::vector<RunFile> parts = between_references(load_record(record, loader));
    leave_out_empty_parts(model, parts);
    for (RunFile& part : parts) {
      for (const Outliers& each : leave_out_outliers(part, model.outputs))
        std::fprintf(stderr, "%s: %s\n", part.name.c_str(), each.text().c_str());
      runs.push_back(std::move(part));
    }
  }
  const CourseFit fit = fit_course(runs, model, correction, options.every_s);
  model.course = fit.course;
  cli::write_file(options.output, write_model(model));
  for (const auto& [name, points] : fit.course.outputs) {
    std::fprintf(stderr, "%s: %zu probings determined gains, %zu kept", name.c_str(),
                 fit.probings.at(name), points.size());
    if (fit.left_out_rms_um.contains(name)) {
      std::fprintf(stderr, "; left-out runs: RMS %.2f um (without a record %.2f um)",
                   fit.left_out_rms_um.at(name), fit.without_rms_um.at(name));
    } else {
      std::fprintf(stderr, "; one run: not tested on another");
    }
    std::fprintf(stderr, "\n");
  }
  return exit_success;
}

void add_correction_command(CLI::App& app, Action& action) {
  const auto options = std::make_shared<CourseOptions>();
  CLI::App* sub = app.add_subcommand(
      "correction", "learns gains of [correction] from probed courses, for use without probing");
  sub->add_option("RECORD", options->records,
                  "run files with probed displacement, RUN.csv[@T0:T1], or histories")
      ->type_name("FILE")
      ->required();
  sub->add_option("--config", options->config,
                  "configuration of the daemon: its model and its [correction]")
      ->type_name("FILE")
      ->required();
  sub->add_option("--columns", options->columns, columns_help)->type_name("FILE");
  sub->add_option("--every-s", options->every_s, "a measured value counts as a probing this often")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  sub->add_option("-o,--output", options->output,
                  "the model file with its table [course]; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, options] { action = [options] { return run_correction(*options); }; });
}

void add_covariance_command(CLI::App& app, Action& action) {
  const auto options = std::make_shared<CovarianceOptions>();
  CLI::App* sub = app.add_subcommand(
      "covariance", "covariance of a model's inputs from records, for estimating lost blocks");
  sub->add_option("--model", options->model, "model file")->type_name("FILE")->required();
  sub->add_option("RECORD", options->records, "run files, RUN.csv[@T0:T1], or histories")
      ->type_name("FILE")
      ->required();
  sub->add_option("--columns", options->columns, columns_help)->type_name("FILE");
  sub->add_option("-o,--output", options->output,
                  "the model file with its table [covariance]; may be the same file; - is standard "
                  "output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, options] { action = [options] { return run_covariance(*options); }; });
}

}  // namespace

void add_model_commands(CLI::App& app, Action& action) {
  const auto predict_options = std::make_shared<PredictOptions>();
  CLI::App* sub = app.add_subcommand("predict",
                                     "applies the model to a run file; prints RMS and largest "
                                     "remainder of each measured output, in um");
  sub->add_option("--model", predict_options->model, "model file")->type_name("FILE")->required();
  sub->add_option("RUN", predict_options->run, "run file, RUN.csv or RUN.csv@T0:T1")
      ->type_name("FILE")
      ->required();
  sub->add_option("--columns", predict_options->columns, columns_help)->type_name("FILE");
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

  add_covariance_command(app, action);
  add_correction_command(app, action);
}

}  // namespace thermocomp::cli
