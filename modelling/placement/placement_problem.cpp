#include "modelling/placement/placement_problem.hpp"

#include <algorithm>
#include <cmath>

#include "config/text/problems.hpp"
#include "estimator/checks.hpp"

namespace thermocomp::placement {
namespace {

using structure::Structure;
using structure::StructureSpec;

/// Adds sensitivities by curve; a guideway's rows include those of its output, as in the daemon.
void add_curves(const StructureSpec& spec, const std::vector<Numbers>& sensitivities,
                PlacementProblem& problem) {
  const auto add_row = [&](const std::vector<const Numbers*>& parts, double weight) {
    Numbers row(problem.nodes_m.size(), 0.0);
    for (const Numbers* part : parts) {
      for (std::size_t node = 0; node < row.size(); ++node) row[node] += 1e6 * (*part)[node];
    }
    problem.sensitivity_um.push_back(std::move(row));
    problem.row_weight.push_back(weight);
  };
  std::vector<bool> carried(spec.outputs.size(), false);
  std::size_t next = spec.outputs.size();
  for (const structure::GuidewayRows& guideway : spec.guideways) {
    for (const auto& [name, direction] : guideway.outputs) {
      std::size_t output = 0;
      while (spec.outputs[output].name != name) ++output;
      carried[output] = true;
      Curve curve{name + " on " + guideway.name, problem.rows(), {}};
      const auto& positions = guideway.positions_mm;
      for (const double at : positions) {
        const double along = (at - positions.front()) / (positions.back() - positions.front());
        curve.at.push_back(2.0 * along - 1.0);
        add_row({&sensitivities[output], &sensitivities[next++]},
                1.0 / static_cast<double>(positions.size()));
      }
      problem.curves.push_back(std::move(curve));
    }
  }
  for (std::size_t i = 0; i < spec.outputs.size(); ++i) {
    if (carried[i]) continue;
    problem.curves.push_back({spec.outputs[i].name, problem.rows(), {0.0}});
    add_row({&sensitivities[i]}, 1.0);
  }
}

Vec3 mean_of(const std::vector<Vec3>& points_m) {
  Vec3 sum{};
  for (const Vec3& point : points_m) sum = sum + point;
  return points_m.empty() ? sum : (1.0 / static_cast<double>(points_m.size())) * sum;
}

Vec3 support_middle_m(const Structure& structure) {
  std::vector<Vec3> held_m;
  for (Index node = 0; node < structure.mesh.nodes_m.size(); ++node) {
    for (Index c = 0; c < 3; ++c) {
      if (!structure.reduction.is_held(node, c)) continue;
      held_m.push_back(structure.mesh.nodes_m[node]);
      break;
    }
  }
  if (held_m.empty()) {
    for (const structure::Coupling& spring : structure.springs) {
      held_m.push_back(structure.mesh.nodes_m[spring.nodes[0]]);
    }
  }
  return mean_of(held_m);
}

/// Excludes nodes at supports and joints, where faces touch.
void leave_out_joints(const Structure& structure, std::vector<bool>& possible) {
  for (const structure::Coupling& spring : structure.springs) {
    for (std::size_t i = 0; i < spring.count; ++i) possible[spring.nodes[i]] = false;
  }
  for (Index node = 0; node < possible.size(); ++node) {
    for (const structure::Weighted& master : structure.reduction.masters_of(node)) {
      possible[node] = possible[master.node] = false;
    }
  }
}

void add_blocks(const StructureSpec& spec, const Structure& structure, PlacementProblem& problem) {
  std::vector<bool> possible(problem.nodes_m.size(), !spec.sensors_on_surface);
  if (spec.sensors_on_surface) {
    for (const structure::Face& face : surface_of(structure.mesh)) {
      for (const Index node : nodes_of(face)) possible[node] = true;
    }
    leave_out_joints(structure, possible);
  }
  for (const std::string& name : structure.block_names) problem.blocks.push_back({name, {}, {}, 0});
  for (Index node = 0; node < problem.nodes_m.size(); ++node) {
    BlockOfSensors& block = problem.blocks[structure.block_of_node[node]];
    block.nodes.push_back(node);
    if (possible[node]) block.candidates.push_back(node);
  }
  const Vec3 support_m = support_middle_m(structure);
  std::vector<Problem> problems;
  for (BlockOfSensors& block : problem.blocks) {
    std::vector<Vec3> points_m;
    for (const Index node : block.nodes) points_m.push_back(problem.nodes_m[node]);
    block.from_support_m = length(mean_of(points_m) - support_m);
    if (!block.candidates.empty()) continue;
    problems.push_back({spec.file.string(), 0, "block", block.name,
                        "has no node on the free surface for a sensor; "
                        "placement.on_surface = false allows any node"});
  }
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
}

void add_patterns(const StructureSpec& spec, PlacementProblem& problem) {
  for (const structure::PatternSpec& from : spec.patterns) {
    Pattern pattern{from.name, std::vector<bool>(problem.blocks.size(), false), from.percents,
                    true};
    for (const Index block : from.blocks) pattern.blocks[block] = true;
    problem.patterns.push_back(std::move(pattern));
  }
}

}  // namespace

PlacementProblem make_problem(const StructureSpec& spec, const Structure& structure,
                              const structure::Statics& statics,
                              std::vector<structure::RiseField> fields) {
  PlacementProblem problem;
  problem.nodes_m = structure.mesh.nodes_m;
  bool any_used = false;
  for (const structure::LoadCaseSpec& load : spec.load_cases) {
    problem.load_cases.push_back({load.name, load.left_out});
    any_used = any_used || !load.left_out;
  }
  if (!any_used) {
    throw ConfigurationError({{spec.file.string(), 0, "load_case", "",
                               "placing sensors needs a [[load_case]] that is not left out"}});
  }
  add_blocks(spec, structure, problem);
  add_patterns(spec, problem);
  add_curves(spec, statics.sensitivities(structure.rows), problem);
  for (const Numbers& row : problem.sensitivity_um) {
    Numbers& blocks = problem.block_matrix_um.emplace_back(problem.blocks.size(), 0.0);
    for (std::size_t node = 0; node < row.size(); ++node) {
      blocks[structure.block_of_node[node]] += row[node];
    }
  }
  for (structure::RiseField& from : fields) {
    Field field{from.load_case, from.time_s, std::move(from.rise_K), {}};
    for (const Numbers& row : problem.sensitivity_um) {
      double sum = 0.0;
      for (std::size_t node = 0; node < row.size(); ++node) sum += row[node] * field.rise_K[node];
      field.displacement_um.push_back(sum);
    }
    const bool left_out = spec.load_cases[field.load_case].left_out;
    (left_out ? problem.left_out : problem.used).push_back(std::move(field));
  }
  return problem;
}

Numbers block_displacement_um(const PlacementProblem& problem, const Numbers& rise_K) {
  Numbers rows_um;
  rows_um.reserve(problem.rows());
  for (const Numbers& row : problem.block_matrix_um) {
    double sum = 0.0;
    for (std::size_t block = 0; block < row.size(); ++block) sum += row[block] * rise_K[block];
    rows_um.push_back(sum);
  }
  return rows_um;
}

double rms_um(const PlacementProblem& problem, const Numbers& rows_um) {
  double squares = 0.0;
  for (std::size_t i = 0; i < rows_um.size(); ++i) {
    squares += problem.row_weight[i] * rows_um[i] * rows_um[i];
  }
  return std::sqrt(squares / static_cast<double>(problem.curves.size()));
}

Numbers block_means_K(const PlacementProblem& problem, const Numbers& rise_K) {
  Numbers means;
  for (const BlockOfSensors& block : problem.blocks) {
    double sum = 0.0;
    for (const Index node : block.nodes) sum += rise_K[node];
    means.push_back(sum / static_cast<double>(block.nodes.size()));
  }
  return means;
}

ErrorFigures errors_of(const PlacementProblem& problem, const std::vector<Field>& fields,
                       const std::vector<Numbers>& estimates_um) {
  THERMOCOMP_ENSURE(fields.size() == estimates_um.size());
  ErrorFigures figures;
  double squares = 0.0;
  for (std::size_t f = 0; f < fields.size(); ++f) {
    Numbers error_um = estimates_um[f];
    for (std::size_t i = 0; i < error_um.size(); ++i) {
      error_um[i] -= fields[f].displacement_um[i];
      figures.peak_um = std::max(figures.peak_um, std::fabs(error_um[i]));
    }
    squares += std::pow(rms_um(problem, error_um), 2);
  }
  figures.rms_um = fields.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(fields.size()));
  return figures;
}

std::vector<Numbers> estimates_um(const PlacementProblem& problem, const std::vector<Field>& fields,
                                  const std::vector<Index>& sensors) {
  std::vector<Numbers> estimates;
  for (const Field& field : fields) {
    Numbers readings_K;
    for (const Index node : sensors) readings_K.push_back(field.rise_K[node]);
    estimates.push_back(block_displacement_um(problem, readings_K));
  }
  return estimates;
}

}  // namespace thermocomp::placement
