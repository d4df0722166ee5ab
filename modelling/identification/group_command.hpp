/// `thermocomp group`: which places warm alike.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace thermocomp::identification {

void add_group_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::identification
