#include "modelling/identification/fit_command.hpp"

#include <charconv>
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/output_file.hpp"
#include "cli/run_loader.hpp"
#include "config/model_file.hpp"
#include "modelling/identification/fit.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t terms_of_any_equation = 8;

struct Options {
  std::vector<std::string> runs;
  std::string columns;
  TestOptions tests;
  std::string terms{"3..5"};
  bool free_choice{false};
  bool lags{false};
  double threshold{-1.0};
  double sensor_error_K{-1.0};  ///< negative: left out
  std::string model;
  std::string report;
  bool json{false};
};

/// "3..5" or "4".
void read_terms(const std::string& text, FitOptions& fit) {
  const auto number = [](std::string_view part, std::size_t& value) {
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    return error == std::errc{} && end == part.data() + part.size();
  };
  const auto dots = text.find("..");
  const std::string_view whole(text);
  const bool read = dots == std::string::npos
                        ? number(whole, fit.terms_min) && number(whole, fit.terms_max)
                        : number(whole.substr(0, dots), fit.terms_min) &&
                              number(whole.substr(dots + 2), fit.terms_max);
  if (read && fit.terms_min >= 1 && fit.terms_min <= fit.terms_max &&
      fit.terms_max <= terms_of_any_equation)
    return;
  throw std::runtime_error("--terms " + text + ": must be a number or a range, like 3..5, in 1..8");
}

void write(const std::string& destination, const std::string& text) {
  cli::OutputFile file(destination);
  file.stream() << text;
  file.commit();
}

int run(const Options& options) {
  FitOptions fit_options;
  read_terms(options.terms, fit_options);
  fit_options.choice = options.free_choice ? Choice::free : Choice::published;
  fit_options.threshold = options.threshold;
  fit_options.lags = options.lags;
  fit_options.sensor_error_K = options.sensor_error_K;
  const std::vector<RunFile> runs = cli::RunLoader(options.columns).load(options.runs);
  const MeasuredTests tests = measured_tests(runs, options.tests);
  const Fit fit = fit_equation(tests, fit_options);
  write(options.model, write_model(model_of(tests, fit)));
  if (!options.report.empty()) write(options.report, fit_html(tests, fit));
  for (const std::string& note : tests.notes) std::fprintf(stderr, "%s\n", note.c_str());
  // A model on the output is not to be mixed with anything.
  if (options.model == "-") return 0;
  write("-", options.json ? fit_json(tests, fit) : fit_text(tests, fit));
  return 0;
}

}  // namespace

void add_fit_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("fit", "sensor choice and model from measured runs");
  sub->add_option("RUN.csv", options->runs, "runs, each one test: RUN.csv[@T0:T1]")->required();
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--outputs", options->tests.outputs, "what is to be predicted: z_um[,...]")
      ->required()
      ->delimiter(',')
      ->type_name("NAME");
  sub->add_option("-o", options->model, "model file for the daemon; - is the output")->required();
  sub->add_option("--terms", options->terms, "how many places: a number or a range in 1..8")
      ->type_name("N..M");
  sub->add_option("--places", options->tests.places, "temperatures to choose from; else all")
      ->delimiter(',')
      ->type_name("NAME");
  sub->add_flag("--free", options->free_choice,
                "any places, not at most two of a group and one of the largest");
  sub->add_option("--threshold", options->threshold,
                  "similarity up to which places are of one group; else chosen")
      ->check(CLI::Range(0.0, 1.0));
  sub->add_flag("--lags", options->lags, "a lag on a term where a left-out test pays for it");
  sub->add_option("--sensor-error-K", options->sensor_error_K,
                  "what each reading may be wrong by: large coefficients that balance each other "
                  "then pay; 0 judges by the tests alone. Left out: 0, with one run 0.1")
      ->check(CLI::Range(0.0, 10.0));
  sub->add_option("--stretches", options->tests.folds_of_one_run,
                  "into how many tests to cut the run when there is only one")
      ->check(CLI::Range(2, 100));
  sub->add_option("--report", options->report, "page with curves and the choice (HTML)");
  sub->add_flag("--json", options->json, "the answer for a program");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::identification
