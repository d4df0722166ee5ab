/// Mesh of a file, before its elements are assigned to parts.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {

/// A mesh file that cannot be read or has unsupported contents; the message gives the place.
class MeshError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct FileMesh {
  struct Volume {
    Shape shape{};
    Index number{0};           ///< number in the file
    std::vector<Index> nodes;  ///< indices into `nodes`
  };
  std::vector<Vec3> nodes;  ///< in the file's unit
  std::vector<Volume> volumes;
  std::map<std::string, std::vector<Index>> volume_groups;  ///< name -> indices into `volumes`
  std::map<std::string, Group> groups;                      ///< every name; nodes and faces
};

/// Reads Abaqus and CalculiX files: *NODE, *ELEMENT of types C3D4, C3D10, C3D8, C3D20 (with their
/// variants), *NSET, *ELSET, *SURFACE; ignores other keywords.
/// @throws MeshError with file and line
[[nodiscard]] FileMesh read_inp(const std::filesystem::path& path);

/// Reads a .msh file of any version that Gmsh reads, with its physical groups.
/// @throws MeshError
[[nodiscard]] FileMesh read_msh(const std::filesystem::path& path);

/// Meshes a STEP geometry with Gmsh; coordinates in m. Edges of quadratic elements are straight.
/// @throws MeshError
[[nodiscard]] FileMesh mesh_step(const std::filesystem::path& path, double size_m, Shape shape);

/// Appends the elements of `group` (none: all) as `part`. Parts from one file share its nodes,
/// which begin at `first_node` (see add_nodes()).
/// @throws MeshError with the existing groups if there is no such group
void add_part(Mesh& mesh, Index part, const FileMesh& file, const std::optional<std::string>& group,
              Index first_node);
/// Appends the file's nodes. @return the index of the first
Index add_nodes(Mesh& mesh, const FileMesh& file, double unit_m);

/// Functions of thermocomp-gmsh.so, for existing files. Only this module links Gmsh: its eighty
/// libraries take most of a start's time, and few commands read a mesh. Program and module come
/// from one build, so exceptions can cross between them.
struct GmshFunctions {
  FileMesh (*read_msh)(const std::filesystem::path& path);
  FileMesh (*mesh_step)(const std::filesystem::path& path, double size_m, Shape shape);
};

}  // namespace thermocomp::structure

/// The only symbol that is looked up.
extern "C" const thermocomp::structure::GmshFunctions thermocomp_gmsh_functions;
