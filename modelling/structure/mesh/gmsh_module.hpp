/// What thermocomp-gmsh.so offers to the program that loads it. Only that module is linked with
/// Gmsh: its eighty libraries cost more than all else at a start, and few commands read a mesh.
/// Program and module come from one build; what is thrown on one side is caught on the other.
#pragma once

#include <filesystem>

#include "modelling/structure/mesh/file_mesh.hpp"

namespace thermocomp::structure {

/// As the functions of file_mesh.hpp, for a file that is there.
struct GmshFunctions {
  FileMesh (*read_msh)(const std::filesystem::path& path);
  FileMesh (*mesh_step)(const std::filesystem::path& path, double size_m, Shape shape);
};

}  // namespace thermocomp::structure

/// The one name that is looked up.
extern "C" const thermocomp::structure::GmshFunctions thermocomp_gmsh_functions;
