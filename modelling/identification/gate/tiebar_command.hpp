/// The command `thermocomp tiebar`: coefficients of a gate-shaped machine with one or more ties,
/// and the ties with the smallest swing on measured temperatures.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::identification {

void add_tiebar_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::identification
