/// The command `thermocomp group`: places that warm alike.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::identification {

void add_group_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::identification
