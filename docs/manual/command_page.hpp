/// The manual page of a program, from its declared command line and what no command line tells.
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

/// In man(7). The line of the footer that begins with "Exit status: " becomes a section.
[[nodiscard]] std::string command_page(const CLI::App& app, const PageExtras& extras);

}  // namespace thermocomp::manual
