/// The command `thermocomp series`: model of a type from runs of its machines.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::series {

void add_series_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::series
