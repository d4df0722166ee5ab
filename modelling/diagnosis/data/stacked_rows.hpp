/// The selected rows of all runs, one below the other.
#pragma once

#include <vector>

#include "modelling/diagnosis/data/block.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// Fewest rows of a block that can be left out.
inline constexpr double block_rows_min = 12;

/// A place of the rows of all selected runs, one below the other.
struct StackedRows {
  std::vector<Block> runs;    ///< rows of each run
  std::vector<Block> blocks;  ///< rows of each block that can be left out, run by run
  Column time_s;
};
[[nodiscard]] StackedRows stacked_rows(const MeasuredData& data);

}  // namespace thermocomp::diagnosis
