/// Manual pages in man(7) and bash completion, from declared command lines and commented examples.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::manual {

struct PageExtras {
  int section{1};
  std::vector<std::pair<std::string, std::string>> environment;  ///< variable, what it does
  std::vector<std::pair<std::string, std::string>> files;        ///< path, what it is
  std::vector<std::string> see_also;                             ///< "thermocomp(1)"
};

/// The page of a program: what --help prints, of the program and of each command. The line of the
/// footer that begins with "Exit status: " becomes a section.
[[nodiscard]] std::string command_page(const CLI::App& app, const PageExtras& extras);

struct FormatPage {
  std::string name;  ///< "thermocompd.toml"
  std::string what;  ///< one line
  std::string text;  ///< paragraphs
  struct Example {
    std::string title;
    std::string toml;  ///< split at its lines "# ------- heading" and "# ======= heading"
  };
  std::vector<Example> examples;
  std::vector<std::string> see_also;
};

/// The page of a file format, section 5: the commented example is the reference.
[[nodiscard]] std::string format_page(const FormatPage& page);

/// A script to be sourced by bash; needs nothing of the package bash-completion. Subcommands and
/// options are offered, files where the type of a value is FILE.
[[nodiscard]] std::string bash_completion(const CLI::App& app);

}  // namespace thermocomp::manual
