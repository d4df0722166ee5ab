/// Orthogonal arrays L4, L8, L9, L12, L16, L18 and L27: levels of any two columns combine equally
/// often.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace thermocomp::experiments {

/// Tests by factors: rows[test][factor] is a level, from 0.
struct Design {
  std::string name;  ///< "L9 (3^4)"
  std::vector<int> level_counts;
  std::vector<std::vector<int>> rows;
};

/// "L4", "L8", ... by size.
[[nodiscard]] const std::vector<std::string>& array_names();

/// The array in every combination of its columns: L16 as 2^15, 4^1 2^12, ... 4^5; L18 as 2^1 3^7
/// and 6^1 3^6. Construction: linear over GF(2) and GF(3) (L4, L8, L16; L9, L27), Plackett and
/// Burman (L12), difference matrix D(6,6,3) (L18).
/// @throws std::invalid_argument for a name that is not in array_names()
[[nodiscard]] std::vector<Design> array_variants(std::string_view name);

/// Columns of the array for factors with the given numbers of levels, in their order. A factor with
/// fewer levels than its column repeats its first levels ("dummy levels"). No rows: does not fit.
struct FittedArray {
  Design design;
  bool dummy_levels{false};
};
[[nodiscard]] FittedArray fit_to(const Design& array, const std::vector<int>& level_counts);

/// Largest t <= 3 for which every t columns contain every combination of their levels equally
/// often; 0: single levels are not balanced.
[[nodiscard]] int strength_of(const Design& design);

}  // namespace thermocomp::experiments
