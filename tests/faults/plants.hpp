/// Bugs planted in the code under test, in the builds that contain them.
#pragma once

#include <string>
#include <vector>

namespace thermocomp::faults {

extern const char* const program_name;

[[nodiscard]] std::vector<std::string> plant_names();
/// @return false: this build has no such bug
[[nodiscard]] bool plant(const std::string& name);

}  // namespace thermocomp::faults
