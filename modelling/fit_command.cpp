#include "modelling/fit_command.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "modelling/identification/equation/fit.hpp"
#include "modelling/identification/families/families.hpp"
#include "modelling/inspection/inspection.hpp"
#include "modelling/series/series.hpp"
#include "report/output_file.hpp"
#include "report/run_loader.hpp"
#include "report/terminal.hpp"

namespace thermocomp {
namespace {

using namespace identification;

constexpr std::size_t terms_of_any_equation = 8;
constexpr std::size_t blocks_of_one_run = 8;
constexpr double doubted_from = 0.9;  ///< as cleaned() does

struct Options {
  std::vector<std::string> runs;
  std::string columns;
  TestOptions tests;
  std::string terms{"3..5"};
  bool free_choice{false};
  bool lags{false};
  double threshold{-1.0};
  double sensor_error_K{-1.0};  ///< negative: left out
  std::string family;
  std::string like;
  std::vector<std::string> diameters;
  std::string model;
  std::string report;
  bool json{false};
  std::string prior;
  double drift_percent{5.0};
  double years{-1.0};  ///< negative: left out

  /// Whether anything was asked for that only an equation of few sensors has.
  [[nodiscard]] bool few_asked_for() const {
    return terms_given || free_choice || lags || threshold >= 0 || sensor_error_K >= 0;
  }
  bool terms_given{false};
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

/// "dia_um=x": of the diameter half goes to the axis; "dia_um=-x": the negative half.
std::vector<DiameterSpec> read_diameters(const Options& options) {
  std::vector<DiameterSpec> diameters;
  for (const std::string& text : options.diameters) {
    const auto equals = text.find('=');
    const bool is_negative = equals != std::string::npos && text.substr(equals + 1, 1) == "-";
    DiameterSpec diameter{text.substr(0, equals), "", is_negative ? -1.0 : 1.0};
    if (equals != std::string::npos) diameter.axis = text.substr(equals + (is_negative ? 2 : 1));
    const std::vector<std::string>& outputs = options.tests.outputs;
    if (diameter.axis.empty() ||
        std::find(outputs.begin(), outputs.end(), diameter.output) == outputs.end())
      throw std::runtime_error("--diameter " + text + ": must be OUTPUT=AXIS, one of --outputs");
    std::fprintf(stderr, "%s: a diameter; axis %s takes out %s\n", diameter.output.c_str(),
                 diameter.axis.c_str(), half_of(diameter).c_str());
    diameters.push_back(std::move(diameter));
  }
  for (const std::string& output : options.tests.outputs)
    if (output.starts_with("dia") &&
        std::none_of(diameters.begin(), diameters.end(),
                     [&](const DiameterSpec& each) { return each.output == output; }))
      std::fprintf(stderr, "%s: taken as the axis' own displacement; a diameter: --diameter %s=x\n",
                   output.c_str(), output.c_str());
  return diameters;
}

/// In the frame of --like where that was given.
std::string model_text(const Options& options, ThermalModel fitted) {
  fitted.diameters = read_diameters(options);
  if (options.like.empty()) return write_model(fitted);
  std::vector<std::string> notes;
  const ThermalModel model = in_frame(fitted, load_model(options.like), notes);
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  return write_model(model);
}

/// One equation of few sensors, as JP7689460B2 has it.
int run_few(const Options& options, const MeasuredTests& tests, const FitOptions& fit_options) {
  const Fit fit = fit_equation(tests, fit_options);
  cli::write_file(options.model, model_text(options, model_of(tests, fit)));
  if (!options.report.empty()) cli::write_file(options.report, fit_html(tests, fit));
  // A model on the output is not to be mixed with anything.
  if (options.model == "-") return 0;
  cli::write_file("-", options.json ? fit_json(tests, fit) : fit_text(tests, fit));
  return 0;
}

int run_families(const Options& options, const MeasuredTests& tests,
                 const FitOptions& fit_options) {
  std::optional<Family> forced;
  if (!options.family.empty()) forced = family_of(options.family);
  std::optional<cli::Progress> progress("comparing models");
  const FamiliesFit fit =
      fit_families(tests, fit_options, forced, [&](double share) { progress->update(share); });
  progress.reset();
  cli::write_file(options.model, model_text(options, fit.model));
  if (!options.report.empty()) cli::write_file(options.report, families_html(tests, fit));
  if (options.model == "-") return 0;
  cli::write_file("-", options.json ? families_json(tests, fit) : families_text(tests, fit));
  return 0;
}

/// The coefficients of a type, or of last year, as far as the runs do not say otherwise.
int run_prior(const Options& options, const std::vector<RunFile>& runs) {
  const series::Series prior =
      series::load_prior(options.prior, options.drift_percent / 100.0, options.years);
  std::vector<std::string> notes;
  const series::Statistics machine = series::statistics_of(
      runs, "the machine", options.tests.outputs, prior.columns.taus_s, notes);
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  const series::Adapted adapted = series::adapted(prior, machine, options.prior);
  cli::write_file(options.model, model_text(options, adapted.model));
  if (options.model == "-") return 0;
  cli::write_file("-", series::adapted_text(prior, machine, adapted, options.json));
  return 0;
}

/// JP7689460B2 chooses among places of the machine; that of the room is none.
void leave_out_room(const std::vector<RunFile>& runs, TestOptions& options) {
  for (const std::string& column : runs.front().columns) {
    if (!is_temperature(column)) continue;
    if (!is_called_like_a_room(column))
      options.places.push_back(column);
    else
      std::fprintf(stderr, "%s: not chosen from, called like a room (--free, --places)\n",
                   column.c_str());
  }
}

/// Readings that `inspect` doubts are fitted to all the same: to mend them is for their owner.
void note_doubtful_readings(const std::vector<RunFile>& runs, MeasuredTests& tests) {
  for (const inspection::Finding& each : inspection::inspect(runs, doubted_from).findings)
    if (std::find(tests.places.begin(), tests.places.end(), each.column) != tests.places.end())
      tests.notes.push_back(runs[each.run].name + ": " + each.text + " (thermocomp inspect, " +
                            std::to_string(std::lround(100.0 * each.probability)) +
                            " %); taken as it is");
}

int run(const Options& options) {
  FitOptions fit_options;
  read_terms(options.terms, fit_options);
  fit_options.choice = options.free_choice ? Choice::free : Choice::published;
  fit_options.threshold = options.threshold;
  fit_options.lags = options.lags;
  fit_options.sensor_error_K = options.sensor_error_K;
  const auto [runs, steps] = inspection::without_steps(
      cli::RunLoader(options.columns).load(options.runs), options.tests.outputs);
  for (const std::string& note : steps) std::fprintf(stderr, "%s\n", note.c_str());
  if (!options.prior.empty()) return run_prior(options, runs);
  TestOptions test_options = options.tests;
  const bool few = options.few_asked_for() && options.family.empty();
  if (few && !options.free_choice && options.tests.places.empty())
    leave_out_room(runs, test_options);
  if (!few) {
    test_options.signals = true;
    test_options.folds_of_one_run = std::max(test_options.folds_of_one_run, blocks_of_one_run);
  }
  MeasuredTests tests = measured_tests(runs, test_options);
  note_doubtful_readings(runs, tests);
  for (const std::string& note : tests.notes) std::fprintf(stderr, "%s\n", note.c_str());
  return few ? run_few(options, tests, fit_options) : run_families(options, tests, fit_options);
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
  sub->add_option(
         "--like", options->like,
         "a model whose inputs and outputs the new one gets, with 0 where the fit uses none: "
         "the daemon's, so that its blocks and axes stay; may be the file of -o")
      ->type_name("MODEL.toml");
  sub->add_option("--diameter", options->diameters,
                  "an output that is a diameter, and the axis that takes out half of it: dia_um=x; "
                  "dia_um=-x where the diameter grows as the axis moves in its negative direction")
      ->delimiter(',')
      ->type_name("OUTPUT=AXIS");
  sub->add_option("--family", options->family,
                  "none, static_few, lagged_few, physical or lag_bank; else what leaves least of "
                  "what is left out")
      ->check(CLI::IsMember({"none", "static_few", "lagged_few", "physical", "lag_bank"}));
  const CLI::Option* terms =
      sub->add_option("--terms", options->terms,
                      "few sensors only, how many: a number or a range in 1..8")
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
  CLI::Option* prior =
      sub->add_option(
             "--prior", options->prior,
             "a series (thermocomp series), or last year's model: its coefficients hold as "
             "far as the runs do not say otherwise")
          ->type_name("SERIES.toml")
          ->excludes("--family", "--terms", "--places", "--free", "--threshold", "--lags",
                     "--sensor-error-K", "--stretches");
  sub->add_option(
         "--drift-percent", options->drift_percent,
         "with --years: share of the displacement by which the prior's prediction may have "
         "moved in a year")
      ->check(CLI::Range(0.0, 100.0))
      ->needs(prior);
  sub->add_option("--years", options->years, "age of the prior; else 0 of a series, 1 of a model")
      ->check(CLI::Range(0.0, 50.0))
      ->needs(prior);
  CLI::Option* report =
      sub->add_option("--report", options->report, "page with curves and the choice (HTML)");
  prior->excludes(report);
  sub->add_flag("--json", options->json, "the answer for a program");
  sub->callback([options, terms, &action] {
    options->terms_given = terms->count() > 0;
    action = [options] { return run(*options); };
  });
}

}  // namespace thermocomp
