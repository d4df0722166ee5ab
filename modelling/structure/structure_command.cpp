#include "modelling/structure/structure_command.hpp"

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <sys/resource.h>

#include "config/model/model_file.hpp"
#include "modelling/structure/body_reduction.hpp"
#include "modelling/structure/pictures.hpp"
#include "modelling/structure/structure_model.hpp"
#include "report/output_file.hpp"

namespace thermocomp::structure {
namespace {

struct Options {
  std::string structure;
  std::string model;
  std::string vtu;
  std::string picture;
  std::string plant;
  bool plant_parts{false};
  SolverChoice solver;
};

/// What begins, with the time since the start, on stderr.
class ProgressLines {
 public:
  void say(std::string_view what) const {
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    std::fprintf(stderr, "%7.1f s  %.*s\n", seconds, static_cast<int>(what.size()), what.data());
  }

 private:
  std::chrono::steady_clock::time_point began_{std::chrono::steady_clock::now()};
};

double peak_memory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

void write(const std::string& destination, const std::string& text) {
  cli::OutputFile file(destination);
  file.stream() << text;
  file.commit();
}

/// The displacements of each block 1 K warm and all else as it was.
std::vector<BlockShape> block_shapes(const Structure& structure, const Statics& statics,
                                     const ProgressLines& progress) {
  std::vector<BlockShape> shapes;
  for (Index block = 0; block < structure.block_names.size(); ++block) {
    progress.say("shape with block " + structure.block_names[block] + " warm");
    std::vector<double> rise_K(structure.mesh.nodes_m.size(), 0.0);
    for (std::size_t node = 0; node < rise_K.size(); ++node) {
      if (structure.block_of_node[node] == block) rise_K[node] = 1.0;
    }
    shapes.push_back({structure.block_names[block], statics.displacement_m(rise_K)});
  }
  return shapes;
}

std::string body_text(const Options& options, const Structure& structure, const ReducedBody& body) {
  std::string comment = "# Made by: thermocomp structure ";
  comment.append(std::filesystem::path(options.structure).filename().string());
  comment.append(" --plant. A machine's body for thermocomp-sim: heat\n# conduction and thermal ");
  comment.append("displacement of ").append(std::to_string(structure.mesh.nodes_m.size()));
  comment.append(" nodes, reduced to ").append(std::to_string(body.states()));
  return write_body(body, comment.append(" states (docs/structure.md).\n"));
}

int run(const Options& options) {
  const ProgressLines progress;
  const StructureSpec spec = load_structure(options.structure);
  const Structure structure =
      build_structure(spec, [&](std::string_view what) { progress.say(what); });
  progress.say("stiffness of " + std::to_string(structure.mesh.nodes_m.size()) +
               " nodes, assembled and made ready to solve");
  const Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                        structure.springs, options.solver);
  progress.say(std::to_string(structure.rows.size()) + " rows, one solve each");
  const ThermalModel model = block_model(spec, structure, statics.sensitivities(structure.rows));
  if (!options.vtu.empty() || !options.picture.empty()) {
    const auto shapes = block_shapes(structure, statics, progress);
    if (!options.vtu.empty()) write(options.vtu, vtu_file(structure, shapes));
    if (!options.picture.empty()) write(options.picture, svg_picture(structure, shapes));
  }
  if (!options.plant.empty()) {
    progress.say("a small state space for the simulator");
    const HeatModel heat = build_heat_model(spec, structure);
    write(options.plant,
          body_text(options, structure,
                    reduce_body(spec, structure, heat, statics, options.plant_parts)));
  }
  write(options.model, write_model(model));
  progress.say("done");
  const std::string report = structure_report(structure, statics, model);
  std::fprintf(options.model == "-" ? stderr : stdout, "%speak memory %.0f MB\n", report.c_str(),
               peak_memory_MB());
  return 0;
}

}  // namespace

void add_structure_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub =
      app.add_subcommand("structure", "block matrix of a structure, by finite elements");
  sub->add_option("STRUCTURE.toml", options->structure, "parts, supports, blocks and outputs")
      ->required();
  sub->add_option("-o,--output", options->model, "the model file to write (- for stdout)")
      ->required();
  sub->add_option("--vtu", options->vtu, "mesh, blocks and deformed shapes, for ParaView");
  sub->add_option("--picture", options->picture, "the same as a picture (SVG)");
  sub->add_option(
      "--plant", options->plant,
      "the machine's body for thermocomp-sim: a reduced model of heat and displacement");
  sub->add_flag("--plant-parts", options->plant_parts,
                "into the same file: each film, joint and part, for thermocomp diagnose --thermal");
  const std::map<std::string, Backend> backends{{"cholmod", Backend::cholmod},
                                                {"petsc", Backend::petsc}};
  sub->add_option("--solver", options->solver.backend,
                  "cholmod (default): one factorisation; petsc: for meshes past this memory")
      ->transform(CLI::CheckedTransformer(backends));
  sub->add_option("--ranks", options->solver.ranks, "MPI ranks of petsc")
      ->check(CLI::Range(1, 256))
      ->default_str("2");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::structure
