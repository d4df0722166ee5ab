#include "modelling/structure/mesh/file_mesh.hpp"

namespace thermocomp::structure {
namespace {

std::string listed(const std::map<std::string, std::vector<Index>>& groups) {
  std::string text;
  for (const auto& [name, volumes] : groups) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "none" : text;
}

}  // namespace

Index add_nodes(Mesh& mesh, const FileMesh& file, double unit_m) {
  const auto first = static_cast<Index>(mesh.nodes_m.size());
  for (const Vec3& node : file.nodes) mesh.nodes_m.push_back(unit_m * node);
  return first;
}

void add_part(Mesh& mesh, Index part, const FileMesh& file, const std::optional<std::string>& group,
              Index first_node) {
  const auto add_volume = [&](const FileMesh::Volume& volume) {
    std::vector<Index> nodes = volume.nodes;
    for (Index& node : nodes) node += first_node;
    mesh.add_element(volume.shape, part, nodes, volume.number);
  };
  if (group) {
    const auto found = file.volume_groups.find(*group);
    if (found == file.volume_groups.end()) {
      throw MeshError("there is no group of volume elements called \"" + *group +
                      "\"; there are: " + listed(file.volume_groups));
    }
    for (const Index volume : found->second) add_volume(file.volumes[volume]);
  } else {
    for (const FileMesh::Volume& volume : file.volumes) add_volume(volume);
  }
  mesh.groups[part] = file.groups;
  for (auto& [name, its] : mesh.groups[part]) {
    for (Index& node : its.nodes) node += first_node;
    for (Face& face : its.faces) {
      const std::size_t count = shape_info(face.shape).nodes;
      for (std::size_t i = 0; i < count; ++i) face.nodes[i] += first_node;
      face.part = part;
    }
  }
}

}  // namespace thermocomp::structure
