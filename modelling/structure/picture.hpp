/// Mesh with blocks and deformed shapes as a picture that needs no other program (SVG).
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/vtu_file.hpp"

namespace thermocomp::structure {

/// One panel with the structure as it is, its blocks in colours, and one for each block: the shape
/// with that block 1 K warm, enlarged so that it shows. The factor stands below each panel.
[[nodiscard]] std::string svg_picture(const Structure& structure,
                                      const std::vector<BlockShape>& shapes);

}  // namespace thermocomp::structure
