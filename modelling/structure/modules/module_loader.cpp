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

[[noreturn]] void fail(const Module& wanted, const std::string& why) {
  std::string text(wanted.name);
  text.append(", which ").append(wanted.does).append(", ").append(why);
  text.append("; it comes with the package thermocomp-modelling, which also needs ");
  throw std::runtime_error(text.append(wanted.needs));
}

const void* loaded_from(const fs::path& folder, const Module& wanted) {
  void* handle = ::dlopen((folder / wanted.name).c_str(), RTLD_LAZY | RTLD_LOCAL);
  const void* functions = handle != nullptr ? ::dlsym(handle, wanted.functions) : nullptr;
  if (functions == nullptr) {
    const char* reason = ::dlerror();
    std::string why = "cannot be loaded from ";
    why.append(folder.string()).append(": ");
    fail(wanted, why.append(reason != nullptr ? reason : "it has no functions"));
  }
  return functions;
}

}  // namespace

const void* functions_of(const Module& wanted) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  const std::array<fs::path, 2> folders{folder, folder.parent_path() / "lib" / "thermocomp"};
  for (const fs::path& place : folders) {
    if (fs::exists(place / wanted.name, error)) return loaded_from(place, wanted);
  }
  fail(wanted, "is neither in " + folders[0].string() + " nor in " + folders[1].string());
}

}  // namespace thermocomp::structure
