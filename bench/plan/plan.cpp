// Sizes of all-pairs plans: well-known sets of factors, and 20 random ones. Every pair is looked up
// in the finished rows, by code independent of the generator. Prints one line per set: its name,
// its levels, the number of tests, and their lower bound (the product of the two largest numbers of
// levels). bench/plan/plan.py adds another generator's sizes.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "modelling/experiments/designs.hpp"

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

/// @return pairs that the plan does not cover
std::size_t show(const std::string& name, std::vector<int> counts, std::uint64_t seed) {
  const Design design = all_pairs(Constraints(counts, {}), seed);
  std::printf("set %s ", name.c_str());
  for (std::size_t i = 0; i < counts.size(); ++i) std::printf(i == 0 ? "%d" : ",%d", counts[i]);
  std::sort(counts.rbegin(), counts.rend());
  std::printf(" %zu %d\n", design.rows.size(), counts[0] * counts[1]);
  return pairs_missing(design);
}

}  // namespace

int main() {
  std::size_t missing = 0;
  missing += show("3^4", levels({{3, 4}}), 1);
  missing += show("3^13", levels({{3, 13}}), 1);
  missing += show("4^15_3^17_2^29", levels({{4, 15}, {3, 17}, {2, 29}}), 1);
  missing += show("4^1_3^39_2^35", levels({{4, 1}, {3, 39}, {2, 35}}), 1);
  missing += show("2^100", levels({{2, 100}}), 1);
  missing += show("10^20", levels({{10, 20}}), 1);
  std::mt19937_64 engine(7);
  for (int set = 1; set <= 20; ++set) {
    std::vector<int> counts;
    const std::size_t factors = 3 + engine() % 8;
    for (std::size_t i = 0; i < factors; ++i) counts.push_back(2 + static_cast<int>(engine() % 4));
    missing += show("random_" + std::to_string(set), counts, engine());
  }
  std::printf("pairs_missing %zu pairs\n", missing);
  return missing == 0 ? 0 : 1;
}
