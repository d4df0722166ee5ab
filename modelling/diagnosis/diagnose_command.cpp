#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/blunders.hpp"
#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/findings.hpp"
#include "modelling/diagnosis/diagnosis.hpp"
#include "modelling/diagnosis/report/diagnosis_report.hpp"
#include "report/output_file.hpp"
#include "report/run_loader.hpp"
#include "report/terminal.hpp"
#ifdef THERMOCOMP_WITH_STRUCTURE
#include "modelling/diagnosis/network/thermal_body.hpp"
#endif

namespace thermocomp::diagnosis {
namespace {

struct Options {
  std::string model;
  std::string thermal;
  std::string structure;
  std::vector<std::string> train;
  std::vector<std::string> test;
  std::string columns;
  std::string folder;
  std::string json;
  bool weighed{false};
};

void print_test_gain(const std::string& output, const TestGain& gain) {
  std::printf("  %s, test rows: RMS %.3f -> %.3f (%.0f %%, 95 %%: %.0f to %.0f)\n", output.c_str(),
              gain.before_um, gain.after_um, 100 * gain.reduction, 100 * gain.ci95.low,
              100 * gain.ci95.high);
}

void print(const RemainderBank& remainder) {
  std::printf("predictable without a name: carried by a bank of lags, last term of the model\n");
  if (remainder.changes_coefficients)
    std::printf(
        "  the model was fitted to these rows: its coefficients change with the bank, and both are "
        "judged fitted anew\n");
  for (const auto& [output, gain] : remainder.left_out)
    std::printf("  %s, rows left out: RMS %.3f -> %.3f\n", output.c_str(), gain.before_um,
                gain.after_um);
  for (const auto& [output, gain] : remainder.test) {
    print_test_gain(output, gain);
    if (!(gain.reduction > 0))
      std::printf("  worse on the test runs: this output goes without it\n");
  }
}

void print(const Diagnosis& diagnosis) {
  std::printf("verdict: %s\n", diagnosis.verdict.c_str());
  for (const NamedFinding& finding : diagnosis.findings) {
    std::printf("%s of %s", finding.cause.c_str(), finding.subject.c_str());
    if (finding.run) std::printf(" in %s", finding.run->c_str());
    std::printf(": %s\n", finding.evidence.c_str());
    if (std::isfinite(finding.probability))
      std::printf("  probability %.2f; %s, %.2f\n", finding.probability, finding.family.c_str(),
                  finding.family_probability);
    if (finding.group.size() > 1) {
      std::printf("  cannot be told apart:");
      for (const std::string& place : finding.group) std::printf(" %s", place.c_str());
      std::printf("\n");
    }
    for (const Parameter& parameter : finding.parameters)
      for (const auto& [output, value] : parameter.values)
        std::printf("  %s%s%s = %.6g\n", parameter.name.c_str(), output.empty() ? "" : " ",
                    output.c_str(), value);
    for (const auto& [output, gain] : finding.test) print_test_gain(output, gain);
    if (fails_on_test_runs(finding))
      std::printf("  worse on the test runs: left out of the extended model\n");
    for (const Alternative& other : finding.alternatives)
      std::printf("  or: %s of %s (support %.2g)\n", other.cause.c_str(), other.subject.c_str(),
                  other.relative_support);
  }
  if (diagnosis.remainder) print(*diagnosis.remainder);
  if (diagnosis.findings.empty())
    for (const auto& [family, probability] : diagnosis.families)
      std::printf("weighed: %s, probability %.2f\n", family.c_str(), probability);
  for (const auto& [output, figures] : diagnosis.outputs)
    if (figures.headroom)
      std::printf(
          "%s: left by the model: noise %.0f %%, named %.0f %%, predictable %.0f %%, not "
          "in this recording %.0f %%\n",
          output.c_str(), 100 * figures.headroom->noise, 100 * figures.headroom->named,
          100 * figures.headroom->predictable, 100 * figures.headroom->not_recorded);
  for (const auto& [output, figures] : diagnosis.outputs)
    std::printf("%s: RMS train %.3f, test %.3f, extended %.3f; without a name %.0f %%\n",
                output.c_str(), figures.train_rms_um, figures.test_rms_um,
                figures.extended_test_rms_um, 100 * figures.unexplained_fraction);
}

constexpr const char* searching = "searching what the model gets wrong";

Diagnosis thermal_diagnosis_of(const Options& options, const std::vector<RunFile>& train,
                               const std::vector<RunFile>& test, const ThermalPlant& plant,
                               ReportData* report, const NetworkView& view = nullptr) {
  cli::Progress line(searching);
  return diagnose_thermal(
      plant, train, options.train, test, options.test, report, [&line] { line.update(-1.0); },
      view);
}

#ifdef THERMOCOMP_WITH_STRUCTURE
/// Also writes body.html into the folder.
Diagnosis diagnosis_with_body(const Options& options, const std::vector<RunFile>& train,
                              const std::vector<RunFile>& test, ReportData* report) {
  const cli::ProgressLines lines;
  ThermalBody body(options.structure, [&](std::string_view what) { lines.print(what); });
  const Diagnosis diagnosis = thermal_diagnosis_of(
      options, train, test, load_thermal_plant(options.thermal, &body.body()), report,
      [&body](const ThermalRuns& runs, const HeatNetwork& before, const HeatNetwork& after) {
        body.show(runs, before, after);
      });
  std::string note = "Rise of the temperature since the start of each test run.";
  if (diagnosis.findings.empty()) note += " Nothing was found wrong.";
  for (const NamedFinding& finding : diagnosis.findings)
    note += " Found: " + title_of(finding.cause, finding.subject) + ".";
  std::filesystem::create_directories(options.folder);
  cli::write_file((std::filesystem::path(options.folder) / "body.html").string(),
                  body.page(std::filesystem::path(options.thermal).stem().string(), note));
  return diagnosis;
}
#endif

Diagnosis diagnosis_of(const Options& options, ReportData* report) {
  cli::RunLoader loader(options.columns);
  std::vector<RunFile> train = loader.load(options.train);
  std::vector<RunFile> test = loader.load(options.test);
  refuse_overlap(train, test);
#ifdef THERMOCOMP_WITH_STRUCTURE
  if (!options.structure.empty()) return diagnosis_with_body(options, train, test, report);
#endif
  if (!options.thermal.empty())
    return thermal_diagnosis_of(options, train, test, load_thermal_plant(options.thermal), report);
  cli::Progress line(searching);
  const auto progress = [&line] { line.update(-1.0); };
  const ThermalModel model = load_model(options.model);
  for (std::vector<RunFile>* runs : {&train, &test})
    for (RunFile& run : *runs)
      for (const Blunders& each : leave_out_blunders(run, model.outputs))
        std::fprintf(stderr, "%s: %s\n", run.name.c_str(), each.text().c_str());
  return diagnose(model, std::move(train), options.train, std::move(test), options.test, report,
                  progress);
}

/// The report, and the model or machine file with the findings that the test runs do not
/// contradict.
void write_folder(const Options& options, const Diagnosis& diagnosis, const ReportData& report) {
  const std::filesystem::path folder(options.folder);
  std::filesystem::create_directories(folder);
  std::vector<NamedFinding> confirmed = diagnosis.findings;
  std::erase_if(confirmed, fails_on_test_runs);
  if (options.thermal.empty())
    cli::write_file((folder / "model.toml").string(), write_model(diagnosis.extended));
  else if (const auto text = corrected_machine(options.thermal, confirmed))
    cli::write_file((folder / "machine.toml").string(), *text);
  cli::write_file((folder / "report.html").string(), report_html(diagnosis, report));
}

int run(const Options& options) {
  if (options.model.empty() == options.thermal.empty())
    throw std::runtime_error("diagnose needs either --model or --thermal");
  if (!options.structure.empty() && (options.thermal.empty() || options.folder.empty()))
    throw std::runtime_error("--structure needs --thermal and --out, where it writes body.html");
  const std::filesystem::path corrected = std::filesystem::path(options.folder) / "machine.toml";
  if (!options.folder.empty() && std::filesystem::exists(corrected) &&
      std::filesystem::exists(options.thermal) &&
      std::filesystem::equivalent(corrected, options.thermal))
    throw std::runtime_error(corrected.string() + ": --out would write over the machine file");
  ReportData report;
  const Diagnosis diagnosis = diagnosis_of(options, options.folder.empty() ? nullptr : &report);
  if (!options.folder.empty()) write_folder(options, diagnosis, report);
  if (!options.json.empty())
    cli::write_file(options.json, diagnosis_json(diagnosis, options.weighed));
  if (options.json != "-") print(diagnosis);
  return 0;
}

}  // namespace

void add_diagnose_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("diagnose", "what a model gets wrong in measured runs, and why");
  command->add_option("--model", options->model, "model file: displacements are compared");
  command->add_option(
      "--thermal", options->thermal,
      "machine file with a [plant], in place of --model: temperatures are compared");
#ifdef THERMOCOMP_WITH_STRUCTURE
  command->add_option("--structure", options->structure,
                      "structure file of the machine's body: --out also receives body.html, the "
                      "test runs in three dimensions and what the findings change");
#endif
  command
      ->add_option("--train", options->train, "runs from which causes are found: RUN.csv[@T0:T1]")
      ->required();
  command->add_option("--test", options->test, "runs on which the gain is measured")->required();
  command->add_option("--columns", options->columns, cli::columns_help);
  command->add_option("--out", options->folder,
                      "folder for the report and the extended model or corrected machine");
  command->add_option("--json", options->json, "file for the answer as JSON; - is the output");
  command->add_flag("--weighed", options->weighed,
                    "the JSON has every hypothesis that was weighed");
  command->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::diagnosis
