#include <map>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "config/text/printable_text.hpp"
#include "modelling/command_line.hpp"
#include "modelling/placement/comparison.hpp"
#include "modelling/structure/pictures.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"

namespace thermocomp::placement {
namespace {

struct Options {
  std::string structure;
  bool json{false};
  bool all{false};
  std::string page;
  std::string vtu;
  TendencyOptions tendency;
};

/// Writes every field of the load cases with its displacement, and the recommended sensors.
void write_pictures(const Options& options, const structure::StructureSpec& spec,
                    const structure::Structure& structure, const structure::Statics& statics,
                    const PlacementProblem& problem, const Comparison& comparison) {
  const MethodResult& best = comparison.best(problem);
  structure::SurfacePicture picture(spec, structure);
  picture.set_title("Sensor positions, " + spec.file.stem().string(),
                    remaining_text(problem, comparison));
  picture.leave_out_sensors();
  for (std::size_t b = 0; b < best.sensors.size(); ++b)
    picture.add_sensor(problem.blocks[b].name, problem.nodes_m[best.sensors[b]]);
  std::vector<structure::NodeValues> values;
  for (const auto* fields : {&problem.used, &problem.left_out}) {
    for (const Field& field : *fields) {
      const std::string& load_case = problem.load_cases[field.load_case].name;
      const Numbers displacement_m = statics.displacement_m(field.rise_K);
      structure::NodeValues moved{load_case + "_" + number_text(field.time_s) + "s_um", 3, {}};
      for (const double value_m : displacement_m) moved.values.push_back(1e6 * value_m);
      values.push_back({load_case + "_" + number_text(field.time_s) + "s_K", 1, field.rise_K});
      values.push_back(std::move(moved));
      picture.add_state({load_case, load_case, field.time_s, "", {}, {}, {}}, field.rise_K,
                        displacement_m);
    }
  }
  if (!options.page.empty()) cli::write_file(options.page, picture.page());
  if (!options.vtu.empty()) cli::write_file(options.vtu, structure::vtu_file(structure, values));
}

int run(const Options& options) {
  const cli::ProgressLines lines;
  const structure::Progress progress = [&](std::string_view what) { lines.print(what); };
  const structure::StructureSpec spec = structure::load_structure(options.structure);
  const structure::Structure structure = structure::build_structure(spec, progress);
  const structure::HeatModel heat = structure::build_heat_model(spec, structure);
  std::vector<structure::RiseField> fields =
      structure::run_load_cases(spec, structure, heat, progress);
  progress("stiffness and sensitivities");
  const structure::Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                                   structure.springs);
  const PlacementProblem problem = make_problem(spec, structure, statics, std::move(fields));
  const Comparison comparison = compare_placements(problem, options.tendency, progress);
  if (!options.page.empty() || !options.vtu.empty())
    write_pictures(options, spec, structure, statics, problem, comparison);
  cli::write_file("-", options.json  ? comparison_json(problem, comparison)
                       : options.all ? comparison_text(problem, comparison)
                                     : recommendation_text(problem, comparison));
  return 0;
}

}  // namespace

void add_place_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("place", "sensor positions of a structure");
  sub->add_option("STRUCTURE.toml", options->structure,
                  "parts, supports, blocks, outputs, heat and load cases")
      ->required();
  sub->add_flag("--json", options->json, "print everything as JSON");
  sub->add_flag("--all", options->all, "print every method and the steps of the patterns");
  sub->add_option("--page", options->page,
                  "write load cases and sensors in three dimensions, for a browser (HTML)");
  sub->add_option("--vtu", options->vtu, "write load cases and sensors for ParaView");
  const std::map<std::string, Start> starts{
      {"mean", Start::mean}, {"median", Start::median}, {"centroid", Start::centroid}};
  sub->add_option("--start", options->tendency.start,
                  "initial block temperatures of the patterns: mean, median or centroid")
      ->transform(CLI::CheckedTransformer(starts).description("mean|median|centroid"));
  sub->add_option("--threshold-um", options->tendency.threshold_um,
                  "RMS error at which the patterns stop")
      ->check(CLI::Range(0.0, 1e6));
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::placement
