#include "modelling/placement/place_command.hpp"

#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "modelling/placement/comparison.hpp"
#include "report/output_file.hpp"

namespace thermocomp::placement {
namespace {

struct Options {
  std::string structure;
  bool json{false};
  TendencyOptions tendency;
};

int run(const Options& options) {
  const structure::Progress progress = [](std::string_view what) {
    std::fprintf(stderr, "%.*s\n", static_cast<int>(what.size()), what.data());
  };
  const structure::StructureSpec spec = structure::load_structure(options.structure);
  const structure::Structure structure = structure::build_structure(spec, progress);
  const structure::HeatModel heat = structure::build_heat_model(spec, structure);
  std::vector<structure::RiseField> fields =
      structure::run_load_cases(spec, structure, heat, progress);
  progress("stiffness and sensitivities");
  const structure::Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                                   structure.springs);
  const PlacementProblem problem = make_problem(spec, structure, statics, std::move(fields));
  progress("placements");
  const Comparison comparison = compare_placements(problem, options.tendency);
  cli::write_file("-", (options.json ? comparison_json(problem, comparison)
                                     : comparison_text(problem, comparison)));
  return 0;
}

}  // namespace

void add_place_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("place", "sensor positions of a structure");
  sub->add_option("STRUCTURE.toml", options->structure,
                  "parts, supports, blocks, outputs, heat and load cases")
      ->required();
  sub->add_flag("--json", options->json, "everything, for a program");
  const std::map<std::string, Start> starts{
      {"mean", Start::mean}, {"median", Start::median}, {"centroid", Start::centroid}};
  sub->add_option("--start", options->tendency.start,
                  "with which block temperatures the patterns begin: mean, median or centroid")
      ->transform(CLI::CheckedTransformer(starts));
  sub->add_option("--threshold-um", options->tendency.threshold_um,
                  "RMS error at which the patterns end")
      ->check(CLI::Range(0.0, 1e6));
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::placement
