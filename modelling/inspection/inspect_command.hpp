/// The command `thermocomp inspect RUN.csv...`
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::inspection {

void add_inspect_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::inspection
