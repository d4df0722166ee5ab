/// `thermocomp tiebar`: the coefficients of a gate-shaped machine with one tie or several, and the
/// ties that a measured course moves least.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::identification {

void add_tiebar_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::identification
