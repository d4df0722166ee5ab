#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "modelling/command_line.hpp"
#include "modelling/identification/equation/fit.hpp"
#include "modelling/identification/families/families.hpp"
#include "modelling/inspection/inspection.hpp"
#include "modelling/series/series.hpp"
#include "report/files.hpp"
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
  double sensor_error_K{-1.0};  ///< negative: not given
  std::string family;
  std::string like;
  std::vector<std::string> diameters;
  std::string model;
  std::string report;
  bool json{false};
  std::string prior;
  double drift_percent{5.0};
  double years{-1.0};  ///< negative: not given

  /// True if an option was given that only applies to few-sensor equations.
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

/// "dia_um=x": axis x corrects half of the diameter; "dia_um=-x": the negative half.
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
    std::fprintf(stderr, "%s: is a diameter; axis %s corrects %s\n", diameter.output.c_str(),
                 diameter.axis.c_str(), half_of(diameter).c_str());
    diameters.push_back(std::move(diameter));
  }
  for (const std::string& output : options.tests.outputs)
    if (output.starts_with("dia") &&
        std::none_of(diameters.begin(), diameters.end(),
                     [&](const DiameterSpec& each) { return each.output == output; }))
      std::fprintf(
          stderr,
          "%s: is taken as the axis' own displacement; if it is a diameter, add --diameter %s=x\n",
          output.c_str(), output.c_str());
  return diameters;
}

/// The model with the inputs and outputs of --like, if given.
std::string model_text(const Options& options, ThermalModel fitted) {
  fitted.diameters = read_diameters(options);
  if (options.like.empty()) return write_model(fitted);
  std::vector<std::string> notes;
  const ThermalModel model = in_frame(fitted, load_model(options.like), notes);
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  return write_model(model);
}

/// A few-sensor equation after JP7689460B2.
int run_few(const Options& options, const MeasuredTests& tests, const FitOptions& fit_options) {
  const Fit fit = fit_equation(tests, fit_options);
  cli::write_file(options.model, model_text(options, model_of(tests, fit)));
  if (!options.report.empty()) cli::write_file(options.report, fit_html(tests, fit));
  // A model on standard output must not be mixed with text.
  if (options.model == "-") return 0;
  cli::write_file("-", options.json ? fit_json(tests, fit) : fit_text(tests, fit));
  return 0;
}

FamiliesFit compared_families(const Options& options, const MeasuredTests& tests,
                              const FitOptions& fit_options) {
  std::optional<Family> forced;
  if (!options.family.empty()) forced = family_of(options.family);
  cli::Progress progress("comparing models");
  return fit_families(tests, fit_options, forced, [&](double share) { progress.update(share); });
}

int write_families(const Options& options, const MeasuredTests& tests, const FamiliesFit& fit) {
  cli::write_file(options.model, model_text(options, fit.model));
  if (!options.report.empty()) cli::write_file(options.report, families_html(tests, fit));
  if (options.model == "-") return 0;
  cli::write_file("-", options.json ? families_json(tests, fit) : families_text(tests, fit));
  return 0;
}

/// Coefficients of a type or of last year's model, updated by the runs; the machine's own fit where
/// the prior does not hold.
int run_prior(const Options& options, const std::vector<RunFile>& runs, const MeasuredTests& tests,
              const FitOptions& fit_options) {
  const series::Series prior =
      series::load_prior(options.prior, options.drift_percent / 100.0, options.years);
  for (const RunFile& run : runs)
    if (is_made_from(prior.runs, run.name))
      std::fprintf(stderr,
                   "warning: %s was fitted to a run called %s: if it is this one, its rows count "
                   "twice, and the error with the prior is that of rows that it was fitted to\n",
                   options.prior.c_str(), run.name.c_str());
  std::vector<std::string> notes;  // those of tests
  const series::Statistics machine =
      series::statistics_of(runs, "the machine", tests.outputs, prior.columns.taus_s, notes);
  const series::Adapted adapted = series::adapted(prior, machine, options.prior);
  const FamiliesFit own = compared_families(options, tests, fit_options);
  const series::PriorJudgement judgement =
      series::judged(prior, runs, tests, own.model, options.prior);
  if (!judgement.holds()) {
    std::fprintf(stderr,
                 "%s%s is not used, since it leaves no less than no model. The model is the "
                 "machine's own fit\n",
                 judgement.text(tests.outputs).c_str(), options.prior.c_str());
    return write_families(options, tests, own);
  }
  if (judgement.own_is_better())
    std::fprintf(stderr,
                 "warning: the machine's own fit leaves less than the prior of these runs. Next: "
                 "judge both (fit with and without --prior) on the next run\n");
  if (prior.machines.size() == 1 && prior.past_of.empty())
    std::fprintf(stderr,
                 "warning: %s is of one machine: how far this one differs from it is assumed "
                 "(--scatter of series, --drift-percent), not measured, and so is the error beyond "
                 "the temperatures and loads of these runs. Next: judge both (fit with and without "
                 "--prior) on a run that goes beyond\n",
                 options.prior.c_str());
  cli::write_file(options.model, model_text(options, adapted.model));
  if (options.model == "-") return 0;
  cli::write_file("-", series::adapted_text(prior, machine, adapted, judgement, options.json));
  return 0;
}

/// JP7689460B2 chooses among places on the machine, without the room temperature.
void leave_out_room(const std::vector<RunFile>& runs, TestOptions& options) {
  for (const std::string& column : runs.front().columns) {
    if (!is_temperature(column)) continue;
    if (!is_called_like_a_room(column))
      options.places.push_back(column);
    else
      std::fprintf(stderr,
                   "%s: excluded, its name is that of a room temperature (--free, --places)\n",
                   column.c_str());
  }
}

/// Leaves out temperatures that the model of --like lacks, since its daemon may lack them.
void leave_out_foreign(const ThermalModel& like, const std::vector<RunFile>& runs,
                       TestOptions& options) {
  const std::vector<std::string> known = like.temperature_columns();
  std::vector<std::string> kept;
  for (const std::string& column : options.places.empty() ? runs.front().columns : options.places) {
    if (!is_temperature(column)) continue;
    if (std::find(known.begin(), known.end(), column) != known.end())
      kept.push_back(column);
    else
      std::fprintf(stderr, "%s: left out, since it is no input of the model of --like (--places)\n",
                   column.c_str());
  }
  if (kept.empty())
    throw std::runtime_error("--like: the runs have none of that model's temperatures");
  options.places = kept;
}

/// Warns of readings that `inspect` doubts. They are used nevertheless: only the user can decide.
void note_doubtful_readings(const std::vector<RunFile>& runs, MeasuredTests& tests) {
  inspection::Inspection inspection;
  {
    cli::Progress progress("inspecting the recordings");
    inspection = inspection::inspect(runs, doubted_from,
                                     [&progress](double share) { progress.update(share); });
  }
  for (const inspection::Finding& each : inspection.findings) {
    if (std::find(tests.places.begin(), tests.places.end(), each.column) == tests.places.end())
      continue;
    // Of spikes, the far ones are left out.
    tests.notes.push_back(runs[each.run].name + ": " + each.text + " (thermocomp inspect, " +
                          std::to_string(std::lround(100.0 * each.probability)) + " %)" +
                          (each.kind == "spikes" ? "" : "; it is used unchanged"));
  }
}

/// A model of all columns has a domain of two features per temperature and one per signal.
void refuse_too_many(const MeasuredTests& tests) {
  if (2 * tests.places.size() + tests.signals.size() <= domain_features_max) return;
  throw std::runtime_error(std::to_string(tests.places.size()) + " temperatures and " +
                           std::to_string(tests.signals.size()) +
                           " signals are too many for one model: twice the temperatures plus the "
                           "signals must be at most " +
                           std::to_string(domain_features_max) +
                           ". Next: thermocomp group shows which warm alike; name one of each "
                           "group in --places, or --family static_few");
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
  TestOptions test_options = options.tests;
  const bool few = options.few_asked_for() && options.family.empty();
  if (few && !options.free_choice && options.tests.places.empty())
    leave_out_room(runs, test_options);
  if (!options.like.empty() && options.tests.places.empty())
    leave_out_foreign(load_model(options.like), runs, test_options);
  if (!few) {
    test_options.signals = true;
    test_options.folds_of_one_run = std::max(test_options.folds_of_one_run, blocks_of_one_run);
  }
  MeasuredTests tests = measured_tests(runs, test_options);
  if (!few && (options.family.empty() || options.family == "lag_bank")) refuse_too_many(tests);
  note_doubtful_readings(runs, tests);
  for (const std::string& note : tests.notes) std::fprintf(stderr, "%s\n", note.c_str());
  if (!options.prior.empty()) return run_prior(options, runs, tests, fit_options);
  if (few) return run_few(options, tests, fit_options);
  return write_families(options, tests, compared_families(options, tests, fit_options));
}

}  // namespace

void add_fit_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("fit", "sensor choice and model from measured runs");
  sub->add_option("RUN.csv", options->runs, "runs, each one test: RUN.csv[@T0:T1]")->required();
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--outputs", options->tests.outputs, "outputs to predict: z_um[,...]")
      ->required()
      ->delimiter(',')
      ->type_name("NAME");
  sub->add_option("-o", options->model, "model file for the daemon; - is standard output")
      ->required();
  sub->add_option(
         "--like", options->like,
         "take inputs and outputs from this model, usually the daemon's; inputs that the fit does "
         "not use get 0; may be the file of -o")
      ->type_name("MODEL.toml");
  sub->add_option("--diameter", options->diameters,
                  "an output that is a diameter, and the axis that corrects half of it: dia_um=x; "
                  "dia_um=-x if the diameter grows when the axis moves in its negative direction")
      ->delimiter(',')
      ->type_name("OUTPUT=AXIS");
  sub->add_option("--family", options->family,
                  "none, static_few, lagged_few, physical or lag_bank; default: lag_bank, or "
                  "static_few where that leaves a tenth less of left-out data; none unless one "
                  "leaves a tenth less than none")
      ->check(CLI::IsMember({"none", "static_few", "lagged_few", "physical", "lag_bank"}));
  const CLI::Option* terms =
      sub->add_option("--terms", options->terms,
                      "number of sensors of a few-sensor equation: a number or a range in 1..8")
          ->type_name("N..M");
  sub->add_option("--places", options->tests.places, "temperatures to choose from; default: all")
      ->delimiter(',')
      ->type_name("NAME");
  sub->add_flag("--free", options->free_choice,
                "choose any places; default: at most two of a group, one of the largest group");
  sub->add_option("--threshold", options->threshold,
                  "largest S within a group of similar places; default: chosen by the fit")
      ->check(CLI::Range(0.0, 1.0));
  sub->add_flag("--lags", options->lags,
                "add a lag to a term if it reduces the error in left-out tests");
  sub->add_option("--sensor-error-K", options->sensor_error_K,
                  "error of each reading, which penalises large coefficients that balance each "
                  "other; default: 0, with one run 0.1")
      ->check(CLI::Range(0.0, 10.0));
  sub->add_option("--stretches", options->tests.folds_of_one_run,
                  "number of tests into which a single run is divided")
      ->check(CLI::Range(2, 100));
  CLI::Option* prior =
      sub->add_option(
             "--prior", options->prior,
             "a series (thermocomp series) or last year's model, whose coefficients the runs "
             "update")
          ->type_name("SERIES.toml")
          ->excludes("--family", "--terms", "--places", "--free", "--threshold", "--lags",
                     "--sensor-error-K", "--stretches");
  sub->add_option(
         "--drift-percent", options->drift_percent,
         "with --years: yearly drift of the prior's prediction, in percent of the displacement")
      ->check(CLI::Range(0.0, 100.0))
      ->needs(prior);
  sub->add_option("--years", options->years,
                  "age of the prior; default: 0 for a series, 1 for a model")
      ->check(CLI::Range(0.0, 50.0))
      ->needs(prior);
  prior->excludes(
      sub->add_option("--report", options->report, "page with curves and the choice (HTML)"));
  sub->add_flag("--json", options->json, "print the result as JSON");
  sub->callback([options, terms, &action] {
    options->terms_given = terms->count() > 0;
    action = [options] { return run(*options); };
  });
}

}  // namespace thermocomp
