/// `thermocomp plan`: tests from factors and levels.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace thermocomp::experiments {

void add_plan_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::experiments
