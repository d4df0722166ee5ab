#include <array>
#include <dlfcn.h>

#include <system_error>

#include "modelling/structure/gmsh_module.hpp"

namespace thermocomp::structure {
namespace {

namespace fs = std::filesystem;

constexpr const char* module_name = "thermocomp-gmsh.so";
constexpr const char* packages =
    "; it comes with the package thermocomp-modelling, which also needs Gmsh's library (Debian 12: "
    "libgmsh4.8)";

/// Not a MeshError: nothing is wrong with the file that was to be read.
[[noreturn]] void fail(const std::string& why) {
  std::string text(module_name);
  text.append(", which reads .msh and STEP files, ").append(why).append(packages);
  throw std::runtime_error(text);
}

/// Loads the module for good: Gmsh and OpenCASCADE are not made for being unloaded.
const GmshFunctions& functions_of(const fs::path& module) {
  void* handle = ::dlopen(module.c_str(), RTLD_LAZY | RTLD_LOCAL);
  const void* functions =
      handle != nullptr ? ::dlsym(handle, "thermocomp_gmsh_functions") : nullptr;
  if (functions == nullptr) {
    const char* reason = ::dlerror();
    std::string why = "cannot be loaded from ";
    why.append(module.parent_path().string()).append(": ");
    fail(why.append(reason != nullptr ? reason : "it holds nothing"));
  }
  return *static_cast<const GmshFunctions*>(functions);
}

/// In a build tree the module lies beside the program, installed in lib/thermocomp.
const GmshFunctions& load() {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  const std::array<fs::path, 2> folders{folder, folder.parent_path() / "lib" / "thermocomp"};
  for (const fs::path& place : folders) {
    if (fs::exists(place / module_name, error)) return functions_of(place / module_name);
  }
  fail("is neither in " + folders[0].string() + " nor in " + folders[1].string());
}

const GmshFunctions& gmsh() {
  static const GmshFunctions& functions = load();  // one that failed is tried again
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
