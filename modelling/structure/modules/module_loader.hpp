/// Modules of this package: shared objects whose libraries only some commands need.
#pragma once

namespace thermocomp::structure {

/// A module, and what is said where it is missing.
struct Module {
  const char* name;       ///< of the file
  const char* does;       ///< "reads ..."
  const char* functions;  ///< the one name in it that is looked up
  const char* needs;      ///< the library that it is linked with, and its package
};

/// Loads the module for good: its libraries are not made to be unloaded. In a build tree it lies
/// beside the program, installed in lib/thermocomp.
/// @throws std::runtime_error, not an error of a file: nothing is wrong with what was to be read
[[nodiscard]] const void* functions_of(const Module& module);

}  // namespace thermocomp::structure
