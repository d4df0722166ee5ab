/// The structure file. Only what can be judged without the meshes is judged here;
/// structure_model.hpp does the rest.
#pragma once

#include <filesystem>
#include <string>

#include "config/text/problems.hpp"
#include "modelling/structure/files/structure_spec.hpp"

namespace thermocomp::structure {

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] StructureSpec load_structure(const std::filesystem::path& path);
/// @param path  stands for the file in problems; mesh files are sought beside it
[[nodiscard]] StructureSpec parse_structure(const std::string& text,
                                            const std::filesystem::path& path);

}  // namespace thermocomp::structure
