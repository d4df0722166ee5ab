/// Mesh, blocks and deformed shapes as a VTK XML file, for ParaView and its like.
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

}  // namespace thermocomp::structure
