#include "modelling/experiments/plan_command.hpp"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "modelling/experiments/test_plan.hpp"
#include "report/output_file.hpp"

namespace thermocomp::experiments {
namespace {

struct Options {
  std::string factors;
  std::string folder;
  bool json{false};
};

int run(const Options& options) {
  const TestPlan plan = make_plan(load_factors(options.factors));
  if (!options.folder.empty()) {
    const std::filesystem::path folder(options.folder);
    std::filesystem::create_directories(folder);
    // A run file may hold an evening's measurements by now: those of an earlier plan stay.
    for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
      char name[32];
      std::snprintf(name, sizeof name, "test_%02zu.csv", test + 1);
      if (std::filesystem::exists(folder / name))
        throw std::runtime_error((folder / name).string() +
                                 " is there already; nothing is written");
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
  sub->add_option("FACTORS.toml", options->factors, "factors, levels, what is forbidden, stops")
      ->required();
  sub->add_option("--out", options->folder,
                  "folder for the sheet, the plan and a run file to fill for each test");
  sub->add_flag("--json", options->json, "the plan for a program");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::experiments
