// Sizes of all-pairs plans: well-known sets of factors, and 20 random ones beside the bound below
// which no plan can go (the product of the two largest numbers of levels). Every pair is looked for
// in the finished rows, by code that shares nothing with the generator.
#include <algorithm>
#include <cstdio>
#include <random>
#include <vector>

#include "modelling/experiments/all_pairs.hpp"

namespace {

using namespace thermocomp::experiments;

std::size_t pairs_missing(const Design& design) {
  std::size_t missing = 0;
  for (std::size_t a = 0; a < design.level_counts.size(); ++a)
    for (std::size_t b = a + 1; b < design.level_counts.size(); ++b)
      for (int x = 0; x < design.level_counts[a]; ++x)
        for (int y = 0; y < design.level_counts[b]; ++y)
          if (std::none_of(design.rows.begin(), design.rows.end(),
                           [&](const auto& row) { return row[a] == x && row[b] == y; }))
            ++missing;
  return missing;
}

std::vector<int> levels(const std::vector<std::pair<int, std::size_t>>& parts) {
  std::vector<int> counts;
  for (const auto& [count, factors] : parts) counts.insert(counts.end(), factors, count);
  return counts;
}

}  // namespace

int main() {
  std::size_t missing = 0;
  const std::vector<std::pair<const char*, std::vector<int>>> known{
      {"3^4", levels({{3, 4}})},
      {"3^13", levels({{3, 13}})},
      {"4^15 3^17 2^29", levels({{4, 15}, {3, 17}, {2, 29}})},
      {"4^1 3^39 2^35", levels({{4, 1}, {3, 39}, {2, 35}})},
      {"2^100", levels({{2, 100}})},
      {"10^20", levels({{10, 20}})}};
  for (const auto& [name, counts] : known) {
    const Design design = all_pairs(Constraints(counts, {}), 1);
    missing += pairs_missing(design);
    std::printf("%-16s %zu tests\n", name, design.rows.size());
  }
  std::mt19937_64 engine(7);
  double ratio = 0.0;
  for (int set = 0; set < 20; ++set) {
    std::vector<int> counts;
    const std::size_t factors = 3 + engine() % 8;
    for (std::size_t i = 0; i < factors; ++i) counts.push_back(2 + static_cast<int>(engine() % 4));
    const Design design = all_pairs(Constraints(counts, {}), engine());
    missing += pairs_missing(design);
    std::sort(counts.rbegin(), counts.rend());
    const int bound = counts[0] * counts[1];
    ratio += static_cast<double>(design.rows.size()) / bound / 20;
    std::printf("random set %2d: %zu factors, %zu tests, at least %d\n", set + 1, factors,
                design.rows.size(), bound);
  }
  std::printf("pairs_missing %zu pairs\nsize_over_bound_mean %.3f ratio\n", missing, ratio);
  return missing == 0 ? 0 : 1;
}
