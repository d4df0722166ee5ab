#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "modelling/command_line.hpp"
#include "modelling/experiments/separation.hpp"
#include "modelling/experiments/test_plan.hpp"
#include "report/files.hpp"

namespace thermocomp::experiments {
namespace {

struct Options {
  std::string factors;
  std::string folder;
  std::vector<std::string> runs;
  std::string columns;
  bool json{false};
};

int run_apart(const Options& options) {
  identification::TestOptions wanted;
  wanted.signals = true;
  const identification::MeasuredTests tests =
      identification::measured_tests(cli::RunLoader(options.columns).load(options.runs), wanted);
  for (const std::string& note : tests.notes) std::fprintf(stderr, "%s\n", note.c_str());
  const Separation found = separation(tests);
  cli::write_file("-", options.json ? separation_json(found) : separation_text(found));
  return 0;
}

int run(const Options& options) {
  if (!options.runs.empty()) return run_apart(options);
  const TestPlan plan = make_plan(load_factors(options.factors));
  if (!options.folder.empty()) {
    const std::filesystem::path folder(options.folder);
    std::filesystem::create_directories(folder);
    // Existing run files are kept, since they may contain measurements of an earlier plan.
    for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
      char name[32];
      std::snprintf(name, sizeof name, "test_%02zu.csv", test + 1);
      if (std::filesystem::exists(folder / name))
        throw std::runtime_error((folder / name).string() + " already exists; nothing was written");
    }
    for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
      char name[32];
      std::snprintf(name, sizeof name, "test_%02zu.csv", test + 1);
      cli::write_file(folder / name, run_file_skeleton(plan, test));
    }
    cli::write_file(folder / "plan.csv", plan_csv(plan));
    cli::write_file(folder / "sheet.md", test_sheet(plan));
  }
  cli::write_file("-", options.json ? plan_json(plan) : plan_text(plan));
  return plan.pairs.covered == plan.pairs.possible ? 0 : 1;
}

}  // namespace

void add_plan_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("plan", "test plan from factors and levels");
  CLI::Option* const factors = sub->add_option("FACTORS.toml", options->factors,
                                               "factors, levels, forbidden combinations, stops");
  CLI::Option* const apart =
      sub->add_option(
             "--apart", options->runs,
             "instead: plan the shortest run that separates columns which moved alike in these "
             "runs")
          ->type_name("RUN.csv")
          ->excludes(factors);
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--out", options->folder,
                  "folder for the sheet, the plan and a run file to fill in for each test")
      ->excludes(apart);
  sub->add_flag("--json", options->json, "print the plan as JSON");
  sub->callback([options, factors, &action] {
    if (options->runs.empty() && factors->empty())
      throw CLI::RequiredError("FACTORS.toml or --apart");
    action = [options] { return run(*options); };
  });
}

}  // namespace thermocomp::experiments
