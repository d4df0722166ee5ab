#include "modelling/structure/structure_model.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "config/text/printable_text.hpp"
#include "modelling/structure/mesh/file_mesh.hpp"
#include "modelling/structure/regions.hpp"
#include "modelling/structure/solve/locate.hpp"

namespace thermocomp::structure {
namespace {

constexpr std::size_t inverted_shown_max = 10;
constexpr double m_to_mm = 1e3;

std::string place_text(const Vec3& point_m) {
  std::string text = "[";
  for (std::size_t d = 0; d < 3; ++d) {
    text.append(d == 0 ? "" : ", ")
        .append(number_text(std::round(point_m[d] * m_to_mm * 1e3) / 1e3));
  }
  return text.append("] mm");
}

class Builder {
 public:
  Builder(const StructureSpec& spec, const Progress& progress) : spec_(spec), progress_(progress) {}

  Structure build() {
    read_meshes();
    finder_.emplace(mesh_, spec_.file.string());
    progress_("supports, joints, blocks and outputs");
    Structure structure{{}, {}, Reduction(node_count(), 3), {}, {}, {}, {}};
    for (const PartSpec& part : spec_.parts) {
      structure.material_of_part.push_back(spec_.materials[part.material]);
    }
    for (const SupportSpec& support : spec_.supports) hold(support, structure.reduction);
    for (const SpringSpec& spring : spec_.springs) add_spring(spring, structure.springs);
    for (const JointSpec& joint : spec_.joints) add_joint(joint, structure);
    assign_blocks(structure);
    add_rows(structure);
    finder_->throw_problems();
    structure.reduction.finish();
    for (const std::string& line : free_motions(mesh_, structure.reduction, structure.springs)) {
      problems_.push_back(
          {spec_.file.string(), 0, "", "", line + "; add a support, springs or a joint"});
    }
    throw_problems();
    structure.mesh = std::move(mesh_);
    return structure;
  }

 private:
  [[nodiscard]] Index node_count() const { return static_cast<Index>(mesh_.nodes_m.size()); }

  void problem(const Origin& origin, std::string rule) {
    problems_.push_back(
        {spec_.file.string(), origin.line, origin.key, origin.value, std::move(rule)});
  }
  void throw_problems() {
    if (!problems_.empty()) throw ConfigurationError(std::move(problems_));
  }

  // ---------------------------------------------------------------- meshes

  void read_meshes() {
    struct Loaded {
      FileMesh file;
      Index first_node;
    };
    std::map<std::string, Loaded> loaded;
    for (const PartSpec& part : spec_.parts) mesh_.part_names.push_back(part.name);
    mesh_.groups.resize(spec_.parts.size());
    for (Index i = 0; i < spec_.parts.size(); ++i) {
      const PartSpec& part = spec_.parts[i];
      progress_("mesh of part " + part.name);
      if (!part.boxes.empty()) {
        if (add_boxes(mesh_, i, part.boxes, part.size_m, part.shape) == 0) {
          problem(part.origin, "no material is left: the boxes cut away the whole part");
        }
        continue;
      }
      try {
        std::string key = part.mesh.string();
        key.append("|").append(number_text(part.length_unit_m)).append("|");
        key.append(number_text(part.size_m[0])).append(shape_info(part.shape).name);
        auto found = loaded.find(key);
        if (found == loaded.end()) {
          Loaded fresh{read_file(part), 0};
          fresh.first_node =
              add_nodes(mesh_, fresh.file, is_geometry(part.mesh) ? 1.0 : part.length_unit_m);
          found = loaded.emplace(key, std::move(fresh)).first;
        }
        add_part(mesh_, i, found->second.file, part.group, found->second.first_node);
      } catch (const MeshError& error) {
        problem(part.origin, error.what());
      }
    }
    throw_problems();
    for (const std::string& line : inverted_elements(mesh_, inverted_shown_max)) {
      problems_.push_back({spec_.file.string(), 0, "", "", line});
    }
    throw_problems();
    drop_unused_nodes(mesh_);
  }

  static bool is_geometry(const std::filesystem::path& path) {
    return path.extension() == ".step" || path.extension() == ".stp";
  }

  static FileMesh read_file(const PartSpec& part) {
    if (is_geometry(part.mesh)) return mesh_step(part.mesh, part.size_m[0], part.shape);
    return part.mesh.extension() == ".inp" ? read_inp(part.mesh) : read_msh(part.mesh);
  }

  // ---------------------------------------------------------------- supports

  void hold(const SupportSpec& support, Reduction& reduction) {
    for (const Index node : finder_->nodes_in(support.on)) {
      for (Index c = 0; c < 3; ++c) {
        if (support.directions[c]) reduction.hold(node, c);
      }
    }
  }

  void add_spring(const SpringSpec& spring, std::vector<Coupling>& couplings) {
    append_shared(couplings_on(mesh_, finder_->faces_in(spring.on)), spring.stiffness_N_per_m,
                  couplings);
  }

  void add_joint(const JointSpec& joint, Structure& structure) {
    if (joint.bonded) {
      tie_faces(*finder_, mesh_, joint, structure.reduction);
    } else {
      append_shared(couplings_between(*finder_, mesh_, joint), joint.stiffness_N_per_m,
                    structure.springs);
    }
  }

  /// Distributes `total` over couplings by their area.
  static void append_shared(std::vector<Coupling> shares, const Vec3& total,
                            std::vector<Coupling>& couplings) {
    double area_m2 = 0.0;
    for (const Coupling& share : shares) area_m2 += share.strength[0];
    for (Coupling& share : shares) {
      share.strength = (share.strength[0] / area_m2) * total;
      couplings.push_back(share);
    }
  }

  // ---------------------------------------------------------------- blocks

  void assign_blocks(Structure& structure) {
    structure.block_of_node.assign(mesh_.nodes_m.size(), no_part);
    std::vector<std::size_t> count(spec_.blocks.size(), 0);
    for (const bool rest : {false, true}) {
      for (Index block = 0; block < spec_.blocks.size(); ++block) {
        if (spec_.blocks[block].rest != rest) continue;
        const auto nodes = rest ? every_node() : finder_->nodes_in(spec_.blocks[block].on);
        for (const Index node : nodes) {
          if (structure.block_of_node[node] != no_part) continue;
          structure.block_of_node[node] = block;
          ++count[block];
        }
        if (count[block] == 0 && !nodes.empty()) {
          finder_->problem(spec_.blocks[block].on.origin,
                           "block " + spec_.blocks[block].name +
                               " has no nodes: they all belong to earlier blocks");
        }
      }
    }
    for (const BlockSpec& block : spec_.blocks) structure.block_names.push_back(block.name);
    const auto& blocks = structure.block_of_node;
    const auto left = std::count(blocks.begin(), blocks.end(), no_part);
    if (left == 0 || finder_->has_problems()) return;
    const auto first = static_cast<Index>(
        std::distance(blocks.begin(), std::find(blocks.begin(), blocks.end(), no_part)));
    finder_->problem({0, "block", ""},
                     std::to_string(left) + " nodes are in no block, the first at " +
                         place_text(mesh_.nodes_m[first]) + "; add a block with rest = true");
  }

  [[nodiscard]] std::vector<Index> every_node() const {
    std::vector<Index> nodes(mesh_.nodes_m.size());
    for (Index i = 0; i < nodes.size(); ++i) nodes[i] = i;
    return nodes;
  }

  // ---------------------------------------------------------------- outputs

  void add_place(const PlaceSpec& place, Vec3 direction, Functional& row, double factor = 1.0) {
    direction = factor * direction;
    const bool tilt = place.at_m.size() == 2;
    const double scale = place.sign / (tilt ? length(place.at_m[1] - place.at_m[0]) : 1.0);
    for (std::size_t i = 0; i < place.at_m.size(); ++i) {
      const auto found = locate_in_part(mesh_, place.part, place.at_m[i],
                                        place.tolerance_m + finder_->tolerance_m());
      if (!found) {
        finder_->problem(place.origin, "the point " + place_text(place.at_m[i]) +
                                           " is outside part " + mesh_.part_names[place.part] +
                                           ", further away than tolerance_mm");
        continue;
      }
      row.add(found->nodes, (tilt && i == 0 ? -scale : scale) * direction);
    }
  }

  void add_rows(Structure& structure) {
    for (const OutputSpec& output : spec_.outputs) {
      Functional& row = structure.rows.emplace_back();
      for (const PlaceSpec& place : output.places) add_place(place, output.direction, row);
    }
    for (const GuidewayRows& guideway : spec_.guideways) {
      for (const auto& [name, direction] : guideway.outputs) {
        for (const PlaceSpec& place : guideway.places) {
          Functional& row = structure.rows.emplace_back();
          add_place(place, direction, row);
          if (guideway.drawn) add_place(*guideway.drawn, direction, row, -1.0);
        }
      }
    }
  }

  const StructureSpec& spec_;
  const Progress& progress_;
  Mesh mesh_;
  std::optional<RegionFinder> finder_;  ///< set after the mesh is read
  std::vector<Problem> problems_;
};

}  // namespace

Structure build_structure(const StructureSpec& spec, const Progress& progress) {
  return Builder(spec, progress).build();
}

ThermalModel block_model(const StructureSpec& spec, const Structure& structure,
                         const std::vector<std::vector<double>>& sensitivities_m_per_K) {
  std::vector<std::vector<double>> rows_um;
  for (const std::vector<double>& sensitivity : sensitivities_m_per_K) {
    std::vector<double>& row = rows_um.emplace_back(structure.block_names.size(), 0.0);
    for (std::size_t node = 0; node < sensitivity.size(); ++node) {
      row[structure.block_of_node[node]] += 1e6 * sensitivity[node];
    }
  }
  ThermalModel model;
  model.inputs = structure.block_names;
  auto next = rows_um.begin();
  for (const OutputSpec& output : spec.outputs) {
    model.outputs.push_back(output.name);
    model.matrix_um_per_K.push_back(*next++);
  }
  for (const GuidewayRows& rows : spec.guideways) {
    GuidewaySpec guideway{rows.name, rows.axis, rows.positions_mm, {}};
    for (const auto& [name, direction] : rows.outputs) {
      const auto end = next + static_cast<std::ptrdiff_t>(rows.positions_mm.size());
      guideway.rows_um_per_K[name].assign(next, end);
      next = end;
    }
    model.guideways.push_back(std::move(guideway));
  }
  return model;
}

}  // namespace thermocomp::structure
