/// Completion of bash for a program, from its declared command line.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::manual {

/// A script to be sourced by bash; needs nothing of the package bash-completion. Subcommands and
/// options are offered, files where the type of a value is FILE.
[[nodiscard]] std::string bash_completion(const CLI::App& app);

}  // namespace thermocomp::manual
