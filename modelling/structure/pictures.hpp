/// Mesh, blocks and deformed shapes: as a VTK XML file, for ParaView and its like, and as a picture
/// that needs no other program (SVG).
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/structure_model.hpp"

namespace thermocomp::structure {

/// The structure with one block 1 K warm.
struct BlockShape {
  std::string block;
  std::vector<double> displacement_m;  ///< shape (3 nodes)
};

/// Point data: `block` (counted from 0) and `NAME_um_per_K` for each shape; cell data: `part`.
[[nodiscard]] std::string vtu_file(const Structure& structure,
                                   const std::vector<BlockShape>& shapes);

/// One panel with the structure as it is, its blocks in colours, and one for each block: the shape
/// with that block 1 K warm, enlarged so that it shows. The factor stands below each panel.
[[nodiscard]] std::string svg_picture(const Structure& structure,
                                      const std::vector<BlockShape>& shapes);

}  // namespace thermocomp::structure
