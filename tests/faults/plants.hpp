/// Bugs that can be planted in the code under test; only in the build that has them compiled in.
#pragma once

#include <string>
#include <vector>

namespace thermocomp::faults {

extern const char* const program_name;

[[nodiscard]] std::vector<std::string> plant_names();
/// @return false: there is no such bug in this build
[[nodiscard]] bool plant(const std::string& name);

}  // namespace thermocomp::faults
