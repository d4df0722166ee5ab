#include "modelling/diagnosis/diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <utility>

#include <CLI/CLI.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "config/text/problems.hpp"
#include "modelling/command_line.hpp"
#include "modelling/diagnosis/answer/diagnosis_report.hpp"
#include "modelling/diagnosis/answer/findings.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/rank/search.hpp"
#include "modelling/diagnosis/thermal_diagnosis.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"
#ifdef THERMOCOMP_WITH_STRUCTURE
#include "modelling/diagnosis/network/thermal_body.hpp"
#endif

namespace thermocomp::diagnosis {
namespace {

/// @return whether a term or a correction represents the finding
bool add_finding(Extended& model, const Finding& finding, const MeasuredData& train) {
  const std::vector<TermSpec> terms = terms_of(finding, train);
  model.model.terms.insert(model.model.terms.end(), terms.begin(), terms.end());
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  const Cause& cause = cause_named(hypothesis.cause);
  if (cause.correction == nullptr) return !terms.empty();
  model.corrections.push_back(cause.correction(parameters_of(finding, train), hypothesis.subject));
  for (const Eigen::VectorXd& gains : finding.explanation.gains)
    model.corrections.back().affects.push_back(gains.size() > 0);
  return true;
}

std::map<std::string, TestGain> gains_on_test(const Extended& before, const Extended& after,
                                              const std::vector<std::string>& outputs,
                                              const MeasuredData& test) {
  std::map<std::string, TestGain> gains;
  const std::vector<Residuals> was = residuals(before, test);
  const std::vector<Residuals> is = residuals(after, test);
  for (std::size_t i = 0; i < was.size(); ++i) {
    const std::string& output = test.model.outputs[i];
    if (std::find(outputs.begin(), outputs.end(), output) != outputs.end() &&
        std::isfinite(root_mean_square(was[i])))
      gains[output] = test_gain(was[i], is[i]);
  }
  return gains;
}

/// The model with its coefficients fitted jointly with the findings.
/// @param errors  relative errors of the coefficients, per output
ThermalModel corrected(ThermalModel model, const std::vector<Eigen::VectorXd>& errors) {
  for (std::size_t output = 0; output < errors.size(); ++output)
    for (std::size_t input = 0; input < model.inputs.size(); ++input)
      model.matrix_um_per_K[output][input] *=
          1.0 + errors[output][static_cast<Eigen::Index>(input)];
  return model;
}

/// Takes the fitted coefficients of outputs that are no worse with them and the finding on the test
/// runs. Fitted with a finding of approximate form, coefficients fit its error, which is wrong
/// elsewhere.
void take_coefficients(Extended& longer, const ThermalModel& fitted, const Extended& before,
                       const MeasuredData& test) {
  longer.model.matrix_um_per_K = fitted.matrix_um_per_K;
  const std::vector<Residuals> was = residuals(before, test);
  const std::vector<Residuals> is = residuals(longer, test);
  for (std::size_t output = 0; output < was.size(); ++output)
    if (root_mean_square(is[output]) > root_mean_square(was[output]))
      longer.model.matrix_um_per_K[output] = before.model.matrix_um_per_K[output];
}

/// Extends the model by one finding after another and measures the gain of each. An output takes
/// the coefficients fitted jointly with all findings as soon as it is no worse with them. A finding
/// that the test runs contradict is reported, not added.
Extended extend(Diagnosis& diagnosis, const SearchResult& result, const MeasuredData& train,
                const MeasuredData& test) {
  Extended extended{train.model, {}};
  const ThermalModel fitted = corrected(train.model, result.coefficient_errors);
  for (const Finding& finding : result.findings) {
    NamedFinding name = named_finding(finding, train, parameters_of(finding, train));
    Extended longer = extended;
    const bool acts = add_finding(longer, finding, train);
    take_coefficients(longer, fitted, extended, test);
    if (acts) name.test = gains_on_test(extended, longer, name.outputs, test);
    if (!fails_on_test_runs(name)) extended = std::move(longer);
    diagnosis.findings.push_back(std::move(name));
  }
  return extended;
}

/// All hypotheses; of the likeliest also the gain on test rows as the only extension.
std::vector<Candidate> candidates_of(const std::vector<Explanation>& weighed,
                                     const MeasuredData& train, const MeasuredData& test) {
  std::vector<Candidate> all;
  for (const Explanation& each : weighed) {
    const Hypothesis& of = *each.hypothesis;
    Candidate candidate{of.cause, of.subject, {}, each.probability, share_of_remainder(each)};
    if (of.run) candidate.run = train.runs[*of.run].name;
    std::vector<std::string> outputs;
    for (std::size_t output = 0; output < each.gains.size(); ++output)
      if (each.gains[output].size() > 0) outputs.push_back(train.model.outputs[output]);
    candidate.figures = {{"score", each.score},
                         {"witness", each.witness},
                         {"left_out", each.left_out},
                         {"left_out_of_best", each.left_out_of_best},
                         {"parameters", free_parameters(of)},
                         {"outputs", outputs.size()}};
    if (all.size() < candidates_reported) {
      Finding alone{each};
      alone.shape_ci.resize(each.shape.size());
      for (const Eigen::VectorXd& gains : each.gains)
        alone.gains_ci.emplace_back(static_cast<std::size_t>(gains.size()));
      const Extended base{train.model, {}};
      Extended longer = base;
      if (add_finding(longer, alone, train))
        candidate.test = gains_on_test(base, longer, outputs, test);
      const Explanation& rival =
          &each == &weighed.front() && weighed.size() > 1 ? weighed[1] : weighed.front();
      candidate.would_decide = experiment_between(
          {of.cause, of.subject, 0.0}, {rival.hypothesis->cause, rival.hypothesis->subject, 0.0});
    }
    all.push_back(std::move(candidate));
  }
  return all;
}

/// The bank is the last term.
void add_remainder(ThermalModel& model, const RemainderBank& remainder) {
  model.terms.insert(model.terms.end(), remainder.hinges.begin(), remainder.hinges.end());
  model.terms.push_back(remainder.term);
}

/// Adds a bank of lags for outputs with enough predictable remainder.
/// @return predictable share of the variance, per output
std::vector<double> add_remainder_bank(Diagnosis& diagnosis, Extended& extended,
                                       const MeasuredData& train, const MeasuredData& test,
                                       const SearchResult& result) {
  // With a finding the coefficients are no longer those of the fit.
  const std::vector<bool> fitted =
      result.findings.empty() ? result.fitted : std::vector<bool>(result.fitted.size());
  std::vector<double> predictable;
  diagnosis.remainder = remainder_bank(train, residuals(extended, train), fitted, predictable);
  if (!diagnosis.remainder) return predictable;
  Extended longer = extended;
  add_remainder(longer.model, *diagnosis.remainder);
  std::vector<std::string> outputs;
  for (const auto& [name, gain] : diagnosis.remainder->left_out) outputs.push_back(name);
  diagnosis.remainder->test = gains_on_test(extended, longer, outputs, test);
  for (const auto& [name, gain] : diagnosis.remainder->test) {
    if (gain.reduction > 0) continue;
    diagnosis.remainder->term.bank.gain_um_per_unit.erase(name);
    for (TermSpec& hinge : diagnosis.remainder->hinges)
      hinge.per_output["gain_um_per_unit"].erase(name);
  }
  if (!diagnosis.remainder->term.bank.gain_um_per_unit.empty())
    add_remainder(extended.model, *diagnosis.remainder);
  return predictable;
}

Headroom headroom(double noise, double unexplained, double predictable) {
  Headroom of;
  of.noise = std::clamp(noise, 0.0, 1.0);
  of.named = (1.0 - of.noise) * (1.0 - std::clamp(unexplained, 0.0, 1.0));
  const double left = 1.0 - of.noise - of.named;
  of.predictable = std::min(left, predictable * (left + of.noise));
  of.not_recorded = left - of.predictable;
  return of;
}

}  // namespace

namespace {

/// The measured displacement as a multiple of the predicted one, if it follows it but for a factor
/// far from 1: another sign or unit, or a model of another machine.
std::vector<std::string> scale_warnings(const MeasuredData& data) {
  constexpr double follows_min = 0.9;  // share of the measured variance
  constexpr Interval usual{0.6, 1.6};
  std::vector<std::string> warnings;
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    double products = 0.0;
    double of_model = 0.0;
    double of_measured = 0.0;
    for (const MeasuredRun& run : data.runs) {
      const auto present = run.measured_um[output].array().isFinite();
      const auto count = static_cast<double>(std::max<Eigen::Index>(present.count(), 1));
      Column measured = present.select(run.measured_um[output].array(), 0.0);
      Column model = present.select(run.model_um[output].array(), 0.0);
      measured = present.select(measured.array() - measured.sum() / count, 0.0);
      model = present.select(model.array() - model.sum() / count, 0.0);
      products += measured.dot(model);
      of_model += model.squaredNorm();
      of_measured += measured.squaredNorm();
    }
    if (!(products * products > follows_min * of_model * of_measured)) continue;
    const double factor = products / of_model;
    if (factor >= usual.low && factor <= usual.high) continue;
    warnings.push_back(data.model.outputs[output] + ": measured is " + figure(factor) +
                       " times predicted, and else follows it. Check sign and unit of the "
                       "displacement (2: a diameter; 25.4: thou; 1000: mm) before all else");
  }
  return warnings;
}

/// @throws ConfigurationError if no output has enough measured values
void require_values(const ThermalModel& model, const std::vector<RunFile>& train) {
  std::size_t most = 0;
  for (const std::string& output : model.outputs) {
    std::size_t values = 0;
    for (const RunFile& run : train)
      if (const auto column = run.find(output))
        for (std::size_t row = run.selected_begin; row < run.selected_end; ++row)
          if (std::isfinite(run.values[*column][row])) ++values;
    most = std::max(most, values);
  }
  if (most < values_min)
    throw ConfigurationError({Problem{"", 0, "--train", std::to_string(most) + " values",
                                      "must have at least " + std::to_string(values_min) +
                                          " measured values of an output of the model"}});
}

}  // namespace

Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train, std::vector<RunFile> test,
                   ReportData* report, const std::function<void()>& progress) {
  require_values(model, train);
  const SharedColumns columns = shared_columns(model, train, test);
  const MeasuredData train_data = measured_data(model, train, columns);
  const MeasuredData test_data = measured_data(model, test, columns);
  train.clear();
  test.clear();
  const std::vector<Hypothesis> all = hypotheses(train_data);
  const SearchResult result = search(train_data, all, progress);

  Diagnosis diagnosis;
  diagnosis.verdict = verdict_of(result);
  diagnosis.warnings = scale_warnings(train_data);
  diagnosis.families = result.families;
  diagnosis.weighed = candidates_of(result.weighed, train_data, test_data);
  Extended extended = extend(diagnosis, result, train_data, test_data);
  const std::vector<double> predictable =
      add_remainder_bank(diagnosis, extended, train_data, test_data, result);
  diagnosis.extended = extended.model;
  const std::vector<Residuals> train_base = residuals(train_data);
  const std::vector<Residuals> base = residuals(test_data);
  const std::vector<Residuals> after = residuals(extended, test_data);
  const std::vector<Residuals> train_after = residuals(extended, train_data);
  for (std::size_t output = 0; output < model.outputs.size(); ++output) {
    const double unexplained =
        all_fail_on_test_runs(diagnosis) ? 1.0 : result.unexplained_share[output];
    OutputFigures& figures = diagnosis.outputs[model.outputs[output]];
    figures = output_figures(train_base[output], base[output], after[output], unexplained);
    // What the extended model removes was no noise, however fast it changed.
    const double left =
        std::pow(root_mean_square(train_after[output]) / root_mean_square(train_base[output]), 2);
    const double noise = std::min(result.noise_share[output], std::isfinite(left) ? left : 1.0);
    figures.headroom = headroom(noise, unexplained, predictable[output]);
  }
  if (report != nullptr) {
    add_runs(*report, diagnosis, train_data, train_base, train_after, false);
    add_runs(*report, diagnosis, test_data, base, after, true);
  }
  return diagnosis;
}

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

constexpr const char* searching = "searching what the model gets wrong";

Diagnosis thermal_diagnosis_of(const std::vector<RunFile>& train, const std::vector<RunFile>& test,
                               const ThermalPlant& plant, ReportData* report,
                               const NetworkView& view = nullptr) {
  cli::Progress line(searching);
  return diagnose_thermal(
      plant, train, test, report, [&line] { line.update(-1.0); }, view);
}

#ifdef THERMOCOMP_WITH_STRUCTURE
/// Also writes body.html into the folder.
Diagnosis diagnosis_with_body(const Options& options, const std::vector<RunFile>& train,
                              const std::vector<RunFile>& test, ReportData* report) {
  const cli::ProgressLines lines;
  ThermalBody body(options.structure, [&](std::string_view what) { lines.print(what); });
  Diagnosis diagnosis =
      thermal_diagnosis_of(train, test, load_thermal_plant(options.thermal, &body.body()), report,
                           [&body](const ThermalRuns& runs, const HeatNetwork& before,
                                   const HeatNetwork& after) { body.show(runs, before, after); });
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
    return thermal_diagnosis_of(train, test, load_thermal_plant(options.thermal), report);
  cli::Progress line(searching);
  const auto progress = [&line] { line.update(-1.0); };
  const ThermalModel model = load_model(options.model);
  for (std::vector<RunFile>* runs : {&train, &test}) {
    leave_out_empty_parts(model, *runs);
    for (RunFile& run : *runs)
      for (const Outliers& each : leave_out_outliers(run, model.outputs))
        std::fprintf(stderr, "%s: %s\n", run.name.c_str(), each.text().c_str());
  }
  return diagnose(model, std::move(train), std::move(test), report, progress);
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
