#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <Eigen/SVD>
#include <sys/resource.h>

#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "modelling/command_line.hpp"
#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/pictures.hpp"
#include "modelling/structure/structure_model.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"

namespace thermocomp::structure {

namespace {

template <class... Values>
std::string line(const char* format, Values... values) {
  char text[256];
  // The formats are literals of this file.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(text, sizeof text, format, values...);
#pragma GCC diagnostic pop
  return text;
}

struct Options {
  std::string structure;
  std::string model;
  std::string vtu;
  std::string picture;
  std::string page;
  std::string run;
  std::string plant;
  bool plant_parts{false};
  bool all{false};
  SolverChoice solver;
};

double peak_memory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Rise of 1 K at the block's nodes, 0 elsewhere.
std::vector<double> one_warm(const Structure& structure, Index block) {
  std::vector<double> rise_K(structure.mesh.nodes_m.size(), 0.0);
  for (std::size_t node = 0; node < rise_K.size(); ++node) {
    if (structure.block_of_node[node] == block) rise_K[node] = 1.0;
  }
  return rise_K;
}

std::vector<BlockShape> block_shapes(const Structure& structure, const Statics& statics,
                                     const cli::ProgressLines& progress) {
  std::vector<BlockShape> shapes;
  for (Index block = 0; block < structure.block_names.size(); ++block) {
    progress.print("shape with block " + structure.block_names[block] + " warm");
    shapes.push_back(
        {structure.block_names[block], statics.displacement_m(one_warm(structure, block))});
  }
  return shapes;
}

/// Adds moments of a run's selected rows: the blocks' shapes times their rise since the first row.
void add_run(const RunFile& run, const ThermalModel& model, const Structure& structure,
             const std::vector<BlockShape>& shapes, SurfacePicture& picture) {
  const std::string name = std::filesystem::path(run.name).stem().string();
  ModelInputs inputs = model_inputs(model, run);
  std::erase_if(inputs.rows, [&](std::size_t row) {
    return row < run.selected_begin || row >= run.selected_end;
  });
  if (inputs.rows.size() < 2)
    throw ConfigurationError(
        {{run.name, 0, "", "",
          "must have at least two selected rows with readings of every block"}});
  for (const std::size_t moment : moments(0, inputs.rows.size() - 1)) {
    const std::size_t row = inputs.rows[moment];
    std::vector<double> rise_K(structure.mesh.nodes_m.size(), 0.0);
    std::vector<double> displacement_m(3 * rise_K.size(), 0.0);
    std::vector<double> block_K;
    for (std::size_t block = 0; block < shapes.size(); ++block) {
      const std::vector<double>& column = *inputs.temperatures[block];
      block_K.push_back(column[row] - column[inputs.rows.front()]);
      for (std::size_t i = 0; i < displacement_m.size(); ++i)
        displacement_m[i] += block_K.back() * shapes[block].displacement_m[i];
    }
    for (std::size_t node = 0; node < rise_K.size(); ++node)
      rise_K[node] = block_K[structure.block_of_node[node]];
    const double time_s = run.time_s()[row] - run.time_s()[inputs.rows.front()];
    picture.add_state({name, name, time_s, "", {}, {}, {}}, rise_K, displacement_m);
  }
  picture.set_title(
      name + ": thermal displacement",
      "Displacement without compensation since the run's first row, computed from the temperatures "
      "of the model's blocks.");
}

std::string page_of(const Options& options, const StructureSpec& spec, const ThermalModel& model,
                    const Structure& structure, const std::vector<BlockShape>& shapes) {
  SurfacePicture picture(spec, structure);
  if (!options.run.empty())
    add_run(cli::RunLoader("").load(options.run), model, structure, shapes, picture);
  for (Index block = 0; block < shapes.size(); ++block) {
    BodyState state;
    state.group = state.name = shapes[block].block + " 1 K warm";
    state.input = shapes[block].block;
    state.time_s = std::numeric_limits<double>::quiet_NaN();
    picture.add_state(std::move(state), one_warm(structure, block), shapes[block].displacement_m);
  }
  return picture.page();
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
  if (!options.run.empty() && options.page.empty())
    throw std::runtime_error("--run requires --page");
  const cli::ProgressLines progress;
  const StructureSpec spec = load_structure(options.structure);
  const Structure structure =
      build_structure(spec, [&](std::string_view what) { progress.print(what); });
  progress.print("stiffness of " + std::to_string(structure.mesh.nodes_m.size()) +
                 " nodes, assembly and factorisation");
  const Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                        structure.springs, options.solver);
  progress.print(std::to_string(structure.rows.size()) + " rows, one solve each");
  const ThermalModel model = block_model(spec, structure, statics.sensitivities(structure.rows));
  if (!options.vtu.empty() || !options.picture.empty() || !options.page.empty()) {
    const auto shapes = block_shapes(structure, statics, progress);
    if (!options.page.empty())
      cli::write_file(options.page, page_of(options, spec, model, structure, shapes));
    if (!options.vtu.empty()) cli::write_file(options.vtu, vtu_file(structure, values_of(shapes)));
    if (!options.picture.empty()) cli::write_file(options.picture, svg_picture(structure, shapes));
  }
  if (!options.plant.empty()) {
    progress.print("reduction to a state-space model for the simulator");
    const HeatModel heat = build_heat_model(spec, structure);
    cli::write_file(
        options.plant,
        body_text(options, structure,
                  reduce_body(spec, structure, heat, statics, options.plant_parts).body));
  }
  cli::write_file(options.model, write_model(model));
  progress.print("done");
  std::string report = structure_report(structure, statics, model, options.all);
  if (options.all) report += line("peak memory %.0f MB\n", peak_memory_MB());
  if (options.model != "-") report.append(options.model).append(": written\n");
  std::fputs(report.c_str(), options.model == "-" ? stderr : stdout);
  return 0;
}

}  // namespace

void add_structure_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub =
      app.add_subcommand("structure", "block matrix of a structure, by finite elements");
  sub->add_option("STRUCTURE.toml", options->structure,
                  "structure file: parts, supports, blocks and outputs")
      ->required();
  sub->add_option("-o,--output", options->model, "model file to write; - is standard output")
      ->required();
  sub->add_option("--vtu", options->vtu, "write mesh, blocks and deformed shapes for ParaView");
  sub->add_option("--picture", options->picture,
                  "write blocks and deformed shapes as a picture (SVG)");
  sub->add_option(
      "--page", options->page,
      "write blocks and deformed shapes in three dimensions, for a browser and the gateway (HTML)");
  sub->add_option(
      "--run", options->run,
      "RUN.csv[@T0:T1] with the blocks' temperatures (thermocomp export), added to the page");
  sub->add_option(
      "--plant", options->plant,
      "write the machine's body for thermocomp-sim: a reduced model of heat and displacement");
  sub->add_flag(
      "--plant-parts", options->plant_parts,
      "add each film, joint and part to the file of --plant, for thermocomp diagnose --thermal");
  sub->add_flag("--all", options->all,
                "also print the rows along the guideways, nodes, singular values and memory");
  const std::map<std::string, Backend> backends{{"cholmod", Backend::cholmod},
                                                {"petsc", Backend::petsc}};
  sub->add_option("--solver", options->solver.backend,
                  "cholmod (default): direct, in memory; petsc: iterative, for larger meshes")
      ->transform(CLI::CheckedTransformer(backends).description("cholmod|petsc"));
  sub->add_option("--ranks", options->solver.ranks, "MPI ranks of petsc")
      ->check(CLI::Range(1, 256))
      ->default_str("2");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

namespace {

using Rows = std::vector<std::vector<double>>;

/// Formats a coefficient; rounding errors of 0 become 0.
std::string coefficient(double value) {
  constexpr double rounding = 1e-6;
  return std::fabs(value) < rounding ? "0" : line("%.4g", value);
}

/// Table with one line per block and one column per row of the matrix.
std::string table_text(const std::vector<std::string>& inputs,
                       const std::vector<std::string>& names, const Rows& rows) {
  std::string text = line("%-24s", "per K");
  for (const std::string& name : names) text += line(" %12s", name.c_str());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    text += line("\n%-24s", inputs[i].c_str());
    for (const std::vector<double>& row : rows) text += line(" %12s", coefficient(row[i]).c_str());
  }
  text += line("\n%-24s", "all alike");
  for (const std::vector<double>& row : rows)
    text += line(" %12s", coefficient(std::accumulate(row.begin(), row.end(), 0.0)).c_str());
  return text + "\n";
}

/// Condition number; if `all`, also the singular values.
std::string conditioning(const Rows& rows, bool all) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()),
                         static_cast<Eigen::Index>(rows.front().size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  const Eigen::VectorXd singular = Eigen::JacobiSVD<Eigen::MatrixXd>(matrix).singularValues();
  std::string text = all ? "singular values of all rows:" : "";
  for (Eigen::Index i = 0; i < singular.size() && all; ++i) text.append(line(" %.3g", singular[i]));
  if (all) text += "\n";
  return text.append(line("condition number of all rows: %.3g\n",
                          singular[0] / std::max(singular[singular.size() - 1], 1e-300)));
}

}  // namespace

std::string structure_report(const Structure& structure, const Statics& statics,
                             const ThermalModel& model, bool all) {
  std::string text = line("%zu nodes, %zu elements, %u unknowns; ", structure.mesh.nodes_m.size(),
                          structure.mesh.elements.size(), structure.reduction.free_size());
  text += statics.solver().report();
  std::vector<std::size_t> nodes(structure.block_names.size(), 0);
  for (const Index block : structure.block_of_node) ++nodes[block];
  for (std::size_t i = 0; i < nodes.size() && all; ++i) {
    text.append("block ").append(structure.block_names[i]).append(line(": %zu nodes\n", nodes[i]));
  }
  text += table_text(model.inputs, model.outputs, model.matrix_um_per_K);
  Rows every = model.matrix_um_per_K;
  for (const GuidewaySpec& guideway : model.guideways) {
    std::vector<std::string> positions;
    for (const double position_mm : guideway.positions_mm)
      positions.push_back(line("at %g mm", position_mm));
    for (const auto& [output, rows] : guideway.rows_um_per_K) {
      every.insert(every.end(), rows.begin(), rows.end());
      if (!all) continue;
      text.append(output).append(" on guideway ").append(guideway.name).append("\n");
      text += table_text(model.inputs, positions, rows);
    }
  }
  if (!all && !model.guideways.empty()) text += "the rows along the guideways: --all\n";
  return text + conditioning(every, all);
}

}  // namespace thermocomp::structure
