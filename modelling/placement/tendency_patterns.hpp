/// Tendency patterns: which blocks are made warmer or cooler together, and by how much.
/// Source: JP6507619B2, the claim, step 5 (steps are counted as in docs/placement.md).
#pragma once

#include <string>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// Of an even number the mean of the two in the middle. @pre not empty
[[nodiscard]] double median_of(Numbers values);

/// What a sensor in each block can read in one field (step 3); shape (blocks).
struct BlockBounds {
  Numbers low_K, high_K;
};
[[nodiscard]] BlockBounds bounds_of(const PlacementProblem& problem, const Field& field);
/// Each block by itself to the nearest bound.
void keep_inside(const BlockBounds& bounds, Numbers& blocks_K);

/// The patterns to try: those of the structure file or, where it has none, derived ones: all
/// blocks; those near to and far from what holds the machine; the warmer and the cooler half; each
/// alone; by 10 and by 5 per cent up and down.
[[nodiscard]] std::vector<Pattern> patterns_of(const PlacementProblem& problem, const Field& field);

struct ChangedBlocks {
  std::string name;  ///< "cooler half +10 %"; "bed +3.2 % (of 10 %)" where r was made smaller
  Numbers blocks_K;  ///< theta3, shape (blocks)
};

/// theta3 = theta2 (1 + r / 100) for the pattern's blocks, theta2 for the others. A pattern of the
/// file whose blocks would leave their bounds gets a smaller r, one for all its blocks; of a
/// derived one each block stays at its own bound.
/// @param percent  r as the pattern has it
/// @param blocks_K  theta2, shape (blocks)
/// @pre blocks_K is inside the bounds
[[nodiscard]] ChangedBlocks change_blocks(const Pattern& pattern, double percent,
                                          const BlockBounds& bounds, const Numbers& blocks_K);

}  // namespace thermocomp::placement
