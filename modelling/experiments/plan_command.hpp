/// The command `thermocomp plan`: tests from factors and levels.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::experiments {

void add_plan_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::experiments
