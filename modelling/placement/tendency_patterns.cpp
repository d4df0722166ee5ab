#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "modelling/placement/tendency_method.hpp"

namespace thermocomp::placement {

double median_of(Numbers values) {
  const std::size_t half = values.size() / 2;
  std::sort(values.begin(), values.end());
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

namespace {

constexpr double per_cent = 0.01;

void add_halves(const Numbers& values, const std::string& low, const std::string& high,
                std::vector<Pattern>& patterns) {
  const double middle = median_of(values);
  Pattern below{low, {}, structure::usual_percents, false};
  Pattern above{high, {}, structure::usual_percents, false};
  for (const double value : values) {
    below.blocks.push_back(value < middle);
    above.blocks.push_back(value > middle);
  }
  patterns.push_back(std::move(below));
  patterns.push_back(std::move(above));
}

/// Largest share of r, 0 to 1, that keeps all blocks of the pattern within their bounds.
double share_inside(const Pattern& pattern, double percent, const BlockBounds& bounds,
                    const Numbers& blocks_K) {
  double share = 1.0;
  for (std::size_t b = 0; b < blocks_K.size(); ++b) {
    if (!pattern.blocks[b]) continue;
    const double change_K = blocks_K[b] * percent * per_cent;
    const double room_K = (change_K > 0.0 ? bounds.high_K[b] : bounds.low_K[b]) - blocks_K[b];
    if (std::fabs(change_K) > std::fabs(room_K)) share = std::min(share, room_K / change_K);
  }
  return share;
}

std::string name_of(const Pattern& pattern, double percent, double share) {
  char text[64];
  if (share < 1.0) {
    std::snprintf(text, sizeof text, " %+.3g %% (of %.3g %%)", share * percent, std::fabs(percent));
  } else {
    std::snprintf(text, sizeof text, " %+.3g %%", percent);
  }
  return pattern.name + text;
}

}  // namespace

BlockBounds bounds_of(const PlacementProblem& problem, const Field& field) {
  constexpr double far = std::numeric_limits<double>::infinity();
  BlockBounds bounds;
  for (const BlockOfSensors& block : problem.blocks) {
    double low = far;
    double high = -far;
    for (const Index node : block.candidates) {
      low = std::min(low, field.rise_K[node]);
      high = std::max(high, field.rise_K[node]);
    }
    bounds.low_K.push_back(low);
    bounds.high_K.push_back(high);
  }
  return bounds;
}

void keep_inside(const BlockBounds& bounds, Numbers& blocks_K) {
  for (std::size_t b = 0; b < blocks_K.size(); ++b) {
    blocks_K[b] = std::clamp(blocks_K[b], bounds.low_K[b], bounds.high_K[b]);
  }
}

std::vector<Pattern> patterns_of(const PlacementProblem& problem, const Field& field) {
  if (!problem.patterns.empty()) return problem.patterns;
  const std::size_t count = problem.blocks.size();
  std::vector<Pattern> patterns{
      {"all", std::vector<bool>(count, true), structure::usual_percents, false}};
  Numbers distances;
  Numbers rises;
  for (const BlockOfSensors& block : problem.blocks) distances.push_back(block.from_support_m);
  for (const double mean : block_means_K(problem, field.rise_K)) rises.push_back(std::fabs(mean));
  add_halves(distances, "near the support", "far from the support", patterns);
  add_halves(rises, "far from the heat", "near the heat", patterns);
  for (std::size_t b = 0; b < count; ++b) {
    Pattern alone{problem.blocks[b].name, std::vector<bool>(count, false),
                  structure::usual_percents, false};
    alone.blocks[b] = true;
    patterns.push_back(std::move(alone));
  }
  return patterns;
}

ChangedBlocks change_blocks(const Pattern& pattern, double percent, const BlockBounds& bounds,
                            const Numbers& blocks_K) {
  const double share =
      pattern.shrinks_as_one ? share_inside(pattern, percent, bounds, blocks_K) : 1.0;
  ChangedBlocks changed{name_of(pattern, percent, share), blocks_K};
  for (std::size_t b = 0; b < blocks_K.size(); ++b) {
    if (pattern.blocks[b]) changed.blocks_K[b] *= 1.0 + share * percent * per_cent;
  }
  keep_inside(bounds, changed.blocks_K);  // only rounding for a pattern that shrinks as one
  return changed;
}

}  // namespace thermocomp::placement
