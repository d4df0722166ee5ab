// thermocomp-gmsh.so: meshes by Gmsh. Uses only headers of the loading program.
#include <algorithm>
#include <cstdio>
#include <gmsh.h>
#include <iostream>
#include <unistd.h>
#include <unordered_map>

#include "modelling/structure/mesh/file_mesh.hpp"

namespace thermocomp::structure {
namespace {

/// Gmsh's index of each of our mid-side nodes.
constexpr std::array<std::size_t, 6> tet10_middles{0, 1, 2, 3, 5, 4};
constexpr std::array<std::size_t, 12> hex20_middles{0, 3, 5, 1, 8, 10, 11, 9, 2, 4, 6, 7};

std::optional<Shape> shape_of_type(int gmsh_type) {
  switch (gmsh_type) {
    case 2:
      return Shape::tri3;
    case 3:
      return Shape::quad4;
    case 4:
      return Shape::tet4;
    case 5:
      return Shape::hex8;
    case 9:
      return Shape::tri6;
    case 11:
      return Shape::tet10;
    case 16:
      return Shape::quad8;
    case 17:
      return Shape::hex20;
    default:
      return std::nullopt;
  }
}

/// Redirects OpenCASCADE's messages to standard error, since the model may go to standard output.
class ReportsToStderr {
 public:
  ReportsToStderr() : stdout_(::dup(STDOUT_FILENO)) {
    std::fflush(stdout);
    ::dup2(STDERR_FILENO, STDOUT_FILENO);
  }
  ~ReportsToStderr() {
    std::cout.flush();
    std::fflush(stdout);
    ::dup2(stdout_, STDOUT_FILENO);
    ::close(stdout_);
  }
  ReportsToStderr(const ReportsToStderr&) = delete;
  ReportsToStderr& operator=(const ReportsToStderr&) = delete;

 private:
  int stdout_;
};

/// Session of Gmsh, which has global state; closed by the destructor.
class GmshSession {
 public:
  explicit GmshSession(const std::filesystem::path& path) : path_(path) {
    gmsh::initialize(0, nullptr, false);
    gmsh::option::setNumber("General.Terminal", 0);
    gmsh::option::setNumber("General.AbortOnError", 0);
    gmsh::logger::start();
  }
  ~GmshSession() {
    try {
      gmsh::finalize();
    } catch (...) {  // the mesh is complete, so the error does not matter
    }
  }
  GmshSession(const GmshSession&) = delete;
  GmshSession& operator=(const GmshSession&) = delete;

  /// Runs a function of Gmsh; converts exceptions of any type to MeshError.
  template <class Action>
  void run(const Action& action) const {
    try {
      action();
    } catch (const MeshError&) {
      throw;
    } catch (...) {
      std::string why;
      gmsh::logger::getLastError(why);
      fail(why.empty() ? "Gmsh cannot read it" : why);
    }
    std::vector<std::string> messages;
    gmsh::logger::get(messages);
    for (const std::string& message : messages) {
      if (message.rfind("Error", 0) == 0) fail(message);
    }
  }

  [[noreturn]] void fail(const std::string& why) const {
    throw MeshError(path_.string() + ": " + why);
  }

 private:
  std::filesystem::path path_;
};

class GmshReader {
 public:
  explicit GmshReader(const GmshSession& session) : session_(session) {}

  FileMesh read() {
    read_nodes();
    gmsh::vectorpair entities;
    gmsh::model::getEntities(entities, 3);
    for (const auto& [dimension, tag] : entities) read_volumes(tag);
    if (mesh_.volumes.empty()) session_.fail("holds no volume elements");
    read_groups();
    return std::move(mesh_);
  }

 private:
  void read_nodes() {
    std::vector<std::size_t> tags;
    std::vector<double> coordinates;
    std::vector<double> parameters;
    gmsh::model::mesh::getNodes(tags, coordinates, parameters, -1, -1, false, false);
    for (std::size_t i = 0; i < tags.size(); ++i) {
      const auto next = static_cast<Index>(mesh_.nodes.size());
      if (!node_of_.try_emplace(tags[i], next).second) continue;
      mesh_.nodes.push_back({coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]});
    }
  }

  Index node(std::size_t tag) const {
    const auto found = node_of_.find(tag);
    if (found == node_of_.end()) session_.fail("there is no node " + std::to_string(tag));
    return found->second;
  }

  /// Calls action(shape, tag, nodes in our order) for the elements of one entity.
  template <class Action>
  void each_element(int dimension, int entity, const Action& action) const {
    std::vector<int> types;
    std::vector<std::vector<std::size_t>> tags;
    std::vector<std::vector<std::size_t>> nodes;
    gmsh::model::mesh::getElements(types, tags, nodes, dimension, entity);
    for (std::size_t t = 0; t < types.size(); ++t) {
      const std::optional<Shape> shape = shape_of_type(types[t]);
      if (!shape) {
        std::string name;
        int of_dimension = 0, order = 0, count = 0, primary = 0;
        std::vector<double> locals;
        gmsh::model::mesh::getElementProperties(types[t], name, of_dimension, order, count, locals,
                                                primary);
        session_.fail("has elements \"" + name +
                      "\"; known are tet4, tet10, hex8 and hex20 (in Gmsh: order 1 or 2, with "
                      "Mesh.SecondOrderIncomplete = 1)");
      }
      const std::size_t count = tags[t].empty() ? 0 : nodes[t].size() / tags[t].size();
      for (std::size_t e = 0; e < tags[t].size(); ++e) {
        std::vector<Index> mine;
        for (std::size_t i = 0; i < count; ++i) {
          mine.push_back(node(nodes[t][e * count + position(*shape, i)]));
        }
        action(*shape, tags[t][e], std::move(mine));
      }
    }
  }

  static std::size_t position(Shape shape, std::size_t i) {
    if (shape == Shape::tet10 && i >= 4) return 4 + tet10_middles[i - 4];
    if (shape == Shape::hex20 && i >= 8) return 8 + hex20_middles[i - 8];
    return i;
  }

  void read_volumes(int entity) {
    each_element(3, entity, [&](Shape shape, std::size_t tag, std::vector<Index> nodes) {
      volumes_of_[entity].push_back(static_cast<Index>(mesh_.volumes.size()));
      mesh_.volumes.push_back({shape, static_cast<Index>(tag), std::move(nodes)});
    });
  }

  void read_groups() {
    gmsh::vectorpair groups;
    gmsh::model::getPhysicalGroups(groups);
    for (const auto& [dimension, tag] : groups) {
      std::string name;
      gmsh::model::getPhysicalName(dimension, tag, name);
      if (name.empty()) name = std::to_string(tag);
      Group& group = mesh_.groups[name];
      std::vector<int> entities;
      gmsh::model::getEntitiesForPhysicalGroup(dimension, tag, entities);
      for (const int entity : entities) add_entity(name, group, dimension, entity);
    }
    for (auto& [name, group] : mesh_.groups) {
      std::sort(group.nodes.begin(), group.nodes.end());
      group.nodes.erase(std::unique(group.nodes.begin(), group.nodes.end()), group.nodes.end());
    }
  }

  void add_entity(const std::string& name, Group& group, int dimension, int entity) {
    const auto take = [&group](const std::vector<Index>& nodes) {
      group.nodes.insert(group.nodes.end(), nodes.begin(), nodes.end());
    };
    if (dimension == 3) {
      for (const Index volume : volumes_of_[entity]) {
        mesh_.volume_groups[name].push_back(volume);
        take(mesh_.volumes[volume].nodes);
      }
    } else if (dimension == 2) {
      each_element(2, entity, [&](Shape shape, std::size_t, const std::vector<Index>& nodes) {
        Face face{shape, 0, {}};
        std::copy(nodes.begin(), nodes.end(), face.nodes.begin());
        group.faces.push_back(face);
        take(nodes);
      });
    } else {
      std::vector<std::size_t> tags;
      std::vector<double> coordinates;
      std::vector<double> parameters;
      gmsh::model::mesh::getNodes(tags, coordinates, parameters, dimension, entity, true, false);
      for (const std::size_t tag : tags) group.nodes.push_back(node(tag));
    }
  }

  const GmshSession& session_;
  FileMesh mesh_;
  std::unordered_map<std::size_t, Index> node_of_;
  std::unordered_map<int, std::vector<Index>> volumes_of_;  ///< by entity
};

FileMesh read_msh_file(const std::filesystem::path& path) {
  const GmshSession session(path);
  session.run([&] { gmsh::open(path.string()); });
  FileMesh mesh;
  session.run([&] { mesh = GmshReader(session).read(); });
  return mesh;
}

FileMesh mesh_step_file(const std::filesystem::path& path, double size_m, Shape shape) {
  const ReportsToStderr reports;
  const GmshSession session(path);
  FileMesh mesh;
  session.run([&] {
    gmsh::option::setString("Geometry.OCCTargetUnit", "M");
    gmsh::vectorpair imported;
    gmsh::model::occ::importShapes(path.string(), imported);
    gmsh::model::occ::synchronize();
    gmsh::option::setNumber("Mesh.MeshSizeMax", size_m);
    gmsh::option::setNumber("Mesh.MeshSizeMin", 0.1 * size_m);
    gmsh::option::setNumber("Mesh.SecondOrderLinear", 1);
    gmsh::model::mesh::generate(3);
    if (shape == Shape::tet10) gmsh::model::mesh::setOrder(2);
  });
  session.run([&] { mesh = GmshReader(session).read(); });
  return mesh;
}

}  // namespace
}  // namespace thermocomp::structure

const thermocomp::structure::GmshFunctions thermocomp_gmsh_functions{
    &thermocomp::structure::read_msh_file, &thermocomp::structure::mesh_step_file};
