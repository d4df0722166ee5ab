/// The command `thermocomp place`: placement of sensors.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::placement {

void add_place_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::placement
