/// The command `thermocomp thermal-test plan|report`.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::thermal_test {

void add_thermal_test_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::thermal_test
