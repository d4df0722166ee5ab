/// A mesh as a file holds it, before parts take what is theirs.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {

/// A mesh file that cannot be read, or holds what we cannot use; says what, and where.
class MeshError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct FileMesh {
  struct Volume {
    Shape shape{};
    Index number{0};           ///< as the file counts
    std::vector<Index> nodes;  ///< indices into `nodes`
  };
  std::vector<Vec3> nodes;  ///< in the file's unit
  std::vector<Volume> volumes;
  std::map<std::string, std::vector<Index>> volume_groups;  ///< name -> indices into `volumes`
  std::map<std::string, Group> groups;                      ///< every name; nodes and faces
};

/// Abaqus and CalculiX: *NODE, *ELEMENT of types C3D4, C3D10, C3D8, C3D20 (with their variants),
/// *NSET, *ELSET, *SURFACE; other keywords are passed over.
/// @throws MeshError with file and line
[[nodiscard]] FileMesh read_inp(const std::filesystem::path& path);

/// A .msh file of any version that Gmsh reads; groups are its physical groups.
/// @throws MeshError
[[nodiscard]] FileMesh read_msh(const std::filesystem::path& path);

/// Geometry (STEP), meshed by Gmsh; coordinates in m. Edges of quadratic elements are straight.
/// @throws MeshError
[[nodiscard]] FileMesh mesh_step(const std::filesystem::path& path, double size_m, Shape shape);

/// Appends the elements of `group` (none: all) as `part`. Parts that come from one file share its
/// nodes: `first_node` is where they stand in the mesh, see add_nodes().
/// @throws MeshError where there is no such group; names those that there are
void add_part(Mesh& mesh, Index part, const FileMesh& file, const std::optional<std::string>& group,
              Index first_node);
/// Appends the file's nodes. @return the index of the first
Index add_nodes(Mesh& mesh, const FileMesh& file, double unit_m);

/// What thermocomp-gmsh.so offers to the program that loads it: the functions above, for a file
/// that is there. Only that module is linked with Gmsh: its eighty libraries cost more than all
/// else at a start, and few commands read a mesh. Program and module come from one build; what is
/// thrown on one side is caught on the other.
struct GmshFunctions {
  FileMesh (*read_msh)(const std::filesystem::path& path);
  FileMesh (*mesh_step)(const std::filesystem::path& path, double size_m, Shape shape);
};

}  // namespace thermocomp::structure

/// The one name that is looked up.
extern "C" const thermocomp::structure::GmshFunctions thermocomp_gmsh_functions;
