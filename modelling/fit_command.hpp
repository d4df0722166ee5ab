/// `thermocomp fit`: sensors and equation from measured runs.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp {

void add_fit_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp
