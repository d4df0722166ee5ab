/// All-pairs plans: all pairs of levels of two factors occur in some test, unless forbidden.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "modelling/experiments/orthogonal_array.hpp"

namespace thermocomp::experiments {

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
  /// The row's set levels contain no forbidden combination.
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
