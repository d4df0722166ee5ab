#include "modelling/structure/mesh/gmsh_module.hpp"
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

}  // namespace

FileMesh read_msh(const fs::path& path) {
  expect_file(path);
  return gmsh().read_msh(path);
}

FileMesh mesh_step(const fs::path& path, double size_m, Shape shape) {
  expect_file(path);
  return gmsh().mesh_step(path, size_m, shape);
}

}  // namespace thermocomp::structure
