/// All-pairs plans: every two levels of every two factors meet in some test, unless something
/// forbids it.
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
/// Levels that must not all occur in one test.
using Forbidden = std::vector<Pick>;

/// What a plan must keep; `no_level` in a row stands for a level still open.
class Constraints {
 public:
  static constexpr int no_level = -1;
  Constraints(std::vector<int> level_counts, std::vector<Forbidden> forbidden);

  [[nodiscard]] bool empty() const noexcept { return forbidden_.empty(); }
  [[nodiscard]] const std::vector<int>& level_counts() const noexcept { return level_counts_; }
  /// Whether the row, as far as it is filled, holds nothing forbidden.
  [[nodiscard]] bool kept_by(const std::vector<int>& row) const noexcept;
  /// The row with its open levels filled in; empty where that is impossible.
  /// @throws std::runtime_error when the search takes too long (a million steps)
  [[nodiscard]] std::vector<int> completed(std::vector<int> row) const;

 private:
  [[nodiscard]] bool complete(std::vector<int>& row, std::size_t factor, std::size_t& steps) const;

  std::vector<int> level_counts_;
  std::vector<Forbidden> forbidden_;
};

struct PairCount {
  std::size_t possible{0};    ///< pairs of levels that some allowed test holds
  std::size_t impossible{0};  ///< pairs that the forbidden combinations rule out
  std::size_t covered{0};     ///< of the possible ones, by the plan
};
[[nodiscard]] PairCount count_pairs(const Design& design, const Constraints& constraints);

/// Greedy rows (of several candidates the one with the most new pairs), begun anew several times;
/// then one test fewer is tried by simulated annealing for as long as that works. Where nothing is
/// forbidden, an orthogonal array that is smaller takes its place. The same seed, the same plan.
/// @throws std::runtime_error when no test at all is allowed
[[nodiscard]] Design all_pairs(const Constraints& constraints, std::uint64_t seed);

}  // namespace thermocomp::experiments
