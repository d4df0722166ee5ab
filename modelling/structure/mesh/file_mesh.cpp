#include "modelling/structure/mesh/file_mesh.hpp"

#include "modelling/structure/modules/module_loader.hpp"

namespace thermocomp::structure {
namespace {

namespace fs = std::filesystem;

constexpr Module module{"thermocomp-gmsh.so", "reads .msh and STEP files",
                        "thermocomp_gmsh_functions", "Gmsh's library (Debian 12: libgmsh4.8)"};

const GmshFunctions& gmsh() {
  // One that failed is tried again.
  static const auto& functions = *static_cast<const GmshFunctions*>(functions_of(module));
  return functions;
}

void expect_file(const fs::path& path) {
  if (!fs::is_regular_file(path)) throw MeshError(path.string() + ": no such file");
}

std::string listed(const std::map<std::string, std::vector<Index>>& groups) {
  std::string text;
  for (const auto& [name, volumes] : groups) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "none" : text;
}

}  // namespace

FileMesh read_msh(const fs::path& path) {
  expect_file(path);
  return gmsh().read_msh(path);
}

FileMesh mesh_step(const fs::path& path, double size_m, Shape shape) {
  expect_file(path);
  return gmsh().mesh_step(path, size_m, shape);
}

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
