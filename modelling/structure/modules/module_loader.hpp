/// Loads this package's modules: shared objects whose libraries only some commands need.
#pragma once

namespace thermocomp::structure {

/// A module, with texts for the message if it is missing.
struct Module {
  const char* name;       ///< file name
  const char* does;       ///< "reads ..."
  const char* functions;  ///< symbol that is looked up
  const char* needs;      ///< library that it links, and its package
};

/// Loads the module permanently, since its libraries do not support unloading. Found beside the
/// program in a build tree, in lib/thermocomp when installed.
/// @throws std::runtime_error, since the input file is not at fault
[[nodiscard]] const void* functions_of(const Module& module);

}  // namespace thermocomp::structure
