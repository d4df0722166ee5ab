#include "modelling/structure/modules/module_loader.hpp"

#include <array>
#include <dlfcn.h>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <system_error>

namespace thermocomp::structure {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const Module& module, const std::string& why) {
  std::string text(module.name);
  text.append(", which ").append(module.does).append(", ").append(why);
  text.append("; it comes with the package thermocomp-modelling, which also needs ");
  throw std::runtime_error(text.append(module.needs));
}

const void* loaded_from(const fs::path& folder, const Module& module) {
  void* handle = ::dlopen((folder / module.name).c_str(), RTLD_LAZY | RTLD_LOCAL);
  const void* functions = handle != nullptr ? ::dlsym(handle, module.functions) : nullptr;
  if (functions == nullptr) {
    const char* reason = ::dlerror();
    std::string why = "cannot be loaded from ";
    why.append(folder.string()).append(": ");
    fail(module, why.append(reason != nullptr ? reason : "it has no functions"));
  }
  return functions;
}

}  // namespace

const void* functions_of(const Module& module) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  const std::array<fs::path, 2> folders{folder, folder.parent_path() / "lib" / "thermocomp"};
  for (const fs::path& place : folders) {
    if (fs::exists(place / module.name, error)) return loaded_from(place, module);
  }
  fail(module, "is neither in " + folders[0].string() + " nor in " + folders[1].string());
}

}  // namespace thermocomp::structure
