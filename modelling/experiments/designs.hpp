/// Designs of tests by factors and levels. Orthogonal arrays L4, L8, L9, L12, L16, L18 and L27:
/// levels of any two columns combine equally often. All-pairs plans: every pair of levels of two
/// factors occurs in some test, unless forbidden.
#pragma once

#include <cstddef>
#include <cstdint>
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

struct Pick {
  std::size_t factor{0};
  int level{0};
};
/// Levels that must not occur together in one test.
using Forbidden = std::vector<Pick>;

/// Constraints of a plan; `no_level` marks an open level of a row.
class Constraints {
 public:
  static constexpr int no_level = -1;
  Constraints(std::vector<int> level_counts, std::vector<Forbidden> forbidden);

  [[nodiscard]] bool empty() const noexcept { return forbidden_.empty(); }
  [[nodiscard]] const std::vector<int>& level_counts() const noexcept { return level_counts_; }
  /// True if the row's set levels contain no forbidden combination.
  [[nodiscard]] bool kept_by(const std::vector<int>& row) const noexcept;
  /// The row with its open levels filled in; empty if impossible.
  /// @throws std::runtime_error if the search takes more than a million steps
  [[nodiscard]] std::vector<int> completed(std::vector<int> row) const;

 private:
  [[nodiscard]] bool complete(std::vector<int>& row, std::size_t factor, std::size_t& steps) const;

  std::vector<int> level_counts_;
  std::vector<Forbidden> forbidden_;
};

struct PairCount {
  std::size_t possible{0};    ///< pairs of levels in some allowed test
  std::size_t impossible{0};  ///< pairs excluded by forbidden combinations
  std::size_t covered{0};     ///< possible pairs in the plan
};
[[nodiscard]] PairCount count_pairs(const Design& design, const Constraints& constraints);

/// Greedy construction (of several candidate rows, the one with the most new pairs), restarted
/// several times; then simulated annealing removes tests one by one while possible. Without
/// forbidden combinations a smaller orthogonal array is preferred. The plan depends only on the
/// seed.
/// @throws std::runtime_error if no test is allowed
[[nodiscard]] Design all_pairs(const Constraints& constraints, std::uint64_t seed);

}  // namespace thermocomp::experiments
