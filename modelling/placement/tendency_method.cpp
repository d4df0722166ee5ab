#include "modelling/placement/tendency_method.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <utility>

#include <Eigen/QR>

#include "estimator/checks.hpp"
#include "modelling/placement/sensor_choice.hpp"

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
  BlockBounds bounds;
  for (const BlockOfSensors& block : problem.blocks) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
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

std::array<double, 3> fit_quadratic(std::span<const double> at, std::span<const double> values) {
  const auto points = static_cast<Eigen::Index>(at.size());
  const Eigen::Index terms = std::min<Eigen::Index>(points, 3);
  Eigen::MatrixXd powers(points, terms);  // 1, X, X^2
  Eigen::VectorXd wanted(points);
  for (Eigen::Index i = 0; i < points; ++i) {
    double power = 1.0;
    for (Eigen::Index j = 0; j < terms; ++j) {
      powers(i, j) = power;
      power *= at[static_cast<std::size_t>(i)];
    }
    wanted[i] = values[static_cast<std::size_t>(i)];
  }
  const Eigen::VectorXd fitted = powers.colPivHouseholderQr().solve(wanted);
  std::array<double, 3> result{};
  for (Eigen::Index j = 0; j < terms; ++j) result[2 - static_cast<std::size_t>(j)] = fitted[j];
  return result;
}

Numbers curve_coefficients(const std::vector<Curve>& curves, const Numbers& rows_um) {
  Numbers coefficients;
  for (const Curve& curve : curves) {
    if (curve.at.size() == 1) {
      coefficients.push_back(rows_um[curve.first_row]);
      continue;
    }
    const auto fit = fit_quadratic(curve.at, {&rows_um[curve.first_row], curve.at.size()});
    coefficients.insert(coefficients.end(), fit.begin(), fit.end());
  }
  return coefficients;
}

namespace {

constexpr double nothing_um = 1e-9;
constexpr double improves_by = 1e-3;  ///< required relative gain of a round
constexpr double same_share = 0.05;   ///< smaller differences of coefficients count as equal
constexpr double far = std::numeric_limits<double>::infinity();

Numbers start_of(const PlacementProblem& problem, const Field& field, Start start) {
  if (start == Start::mean) return block_means_K(problem, field.rise_K);
  Numbers blocks_K;
  for (const BlockOfSensors& block : problem.blocks) {
    if (start == Start::centroid) {
      blocks_K.push_back(field.rise_K[centroid_node(problem, block)]);
      continue;
    }
    Numbers sorted;
    for (const Index node : block.nodes) sorted.push_back(field.rise_K[node]);
    blocks_K.push_back(median_of(std::move(sorted)));
  }
  return blocks_K;
}

Numbers difference(const Numbers& a, const Numbers& b) {
  Numbers result = a;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] -= b[i];
  return result;
}

double product(const PlacementProblem& problem, const Numbers& a, const Numbers& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += problem.row_weight[i] * a[i] * b[i];
  return sum;
}

double size_of(const Numbers& values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0));
}

/// Indices of coefficients, sorted by the magnitude of `needed`.
std::vector<std::size_t> largest_first(const Numbers& needed) {
  std::vector<std::size_t> order(needed.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::fabs(needed[a]) > std::fabs(needed[b]);
  });
  return order;
}

/// Distance of a tendency from the needed shape, compared lexicographically.
Numbers distance(Way way, const PlacementProblem& problem, const Numbers& needed_um,
                 const Numbers& tendency_um) {
  if (way == Way::difference) {
    const double cosine = product(problem, needed_um, tendency_um) /
                          std::sqrt(product(problem, needed_um, needed_um) *
                                    product(problem, tendency_um, tendency_um));
    return {1.0 - std::fabs(cosine)};
  }
  const Numbers needed = curve_coefficients(problem.curves, needed_um);
  const Numbers tendency = curve_coefficients(problem.curves, tendency_um);
  const auto order = largest_first(needed);
  const double lead = tendency[order[0]];
  if (way == Way::ratios) {
    if (!(std::fabs(lead) > nothing_um)) return {far};
    double squares = 0.0;
    for (const std::size_t i : order) {
      squares += std::pow(needed[i] / needed[order[0]] - tendency[i] / lead, 2);
    }
    return {squares};
  }
  // Scaled with the sign that makes the largest coefficients agree.
  const double scale = std::copysign(size_of(needed) / size_of(tendency), needed[order[0]] * lead);
  Numbers differences;
  for (const std::size_t i : order) {
    const double share = std::fabs(needed[i] - scale * tendency[i]) / std::fabs(needed[order[0]]);
    differences.push_back(std::floor(share / same_share));
  }
  return differences;
}

struct Candidate {
  std::string name;
  Numbers blocks_K;     ///< theta3
  Numbers tendency_um;  ///< delta3 - delta2
  Numbers distance;
};

/// Steps 5 to 7; the nearest in shape comes first.
std::vector<Candidate> candidates_of(const PlacementProblem& problem,
                                     const std::vector<Pattern>& patterns,
                                     const BlockBounds& bounds, const Numbers& blocks_K,
                                     const Numbers& needed_um, Way way) {
  std::vector<Candidate> candidates;
  const Numbers present_um = block_displacement_um(problem, blocks_K);
  for (const Pattern& pattern : patterns) {
    for (const double percent : pattern.percents) {
      ChangedBlocks changed = change_blocks(pattern, percent, bounds, blocks_K);
      Candidate candidate{std::move(changed.name), std::move(changed.blocks_K), {}, {}};
      candidate.tendency_um =
          difference(block_displacement_um(problem, candidate.blocks_K), present_um);
      if (!(size_of(candidate.tendency_um) > nothing_um)) continue;
      candidate.distance = distance(way, problem, needed_um, candidate.tendency_um);
      candidates.push_back(std::move(candidate));
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
  return candidates;
}

}  // namespace

std::string_view name_of(Way way) {
  switch (way) {
    case Way::coefficients:
      return "coefficients";
    case Way::ratios:
      return "ratios";
    case Way::difference:
      return "difference";
  }
  THERMOCOMP_ENSURE(false);
  return "";
}

TendencyRun run_tendencies(const PlacementProblem& problem, const Field& field, Way way,
                           const TendencyOptions& options) {
  TendencyRun run;
  const BlockBounds bounds = bounds_of(problem, field);
  const std::vector<Pattern> patterns = patterns_of(problem, field);
  run.blocks_K = start_of(problem, field, options.start);
  keep_inside(bounds, run.blocks_K);
  Numbers needed_um =
      difference(field.displacement_um, block_displacement_um(problem, run.blocks_K));
  double error_um = run.error_um_at_start = rms_um(problem, needed_um);
  while (run.ended.empty()) {
    if (error_um <= options.threshold_um) {
      run.ended = "the error is below the threshold";
      break;
    }
    if (static_cast<int>(run.rounds.size()) >= options.rounds_max) {
      run.ended = "the maximum number of rounds is reached";
      break;
    }
    run.ended = "no pattern reduces the error within the range of possible readings";
    int rank = 0;
    for (const Candidate& candidate :
         candidates_of(problem, patterns, bounds, run.blocks_K, needed_um, way)) {
      ++rank;
      const double rho = product(problem, needed_um, candidate.tendency_um) /
                         product(problem, candidate.tendency_um, candidate.tendency_um);
      Numbers next_K = run.blocks_K;
      for (std::size_t b = 0; b < next_K.size(); ++b) {
        next_K[b] = rho * candidate.blocks_K[b] + (1.0 - rho) * run.blocks_K[b];
      }
      keep_inside(bounds, next_K);
      const Numbers left_um =
          difference(field.displacement_um, block_displacement_um(problem, next_K));
      const double next_um = rms_um(problem, left_um);
      if (!(next_um < error_um * (1.0 - improves_by))) continue;
      run.rounds.push_back({candidate.name, rank, rho, next_um});
      run.blocks_K = next_K;
      needed_um = left_um;
      error_um = next_um;
      run.ended.clear();
      break;
    }
  }
  return run;
}

TendencyPlacement place_by_tendencies(const PlacementProblem& problem, Way way,
                                      const TendencyOptions& options) {
  TendencyPlacement placement{way, {}, {}};
  for (const Field& field : problem.used) {
    placement.runs.push_back(run_tendencies(problem, field, way, options));
  }
  for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
    Index best = problem.blocks[b].candidates.front();
    double least = far;
    for (const Index node : problem.blocks[b].candidates) {
      double squares = 0.0;
      for (std::size_t f = 0; f < problem.used.size(); ++f) {
        squares += std::pow(problem.used[f].rise_K[node] - placement.runs[f].blocks_K[b], 2);
      }
      if (squares < least) {
        least = squares;
        best = node;
      }
    }
    placement.sensors.push_back(best);
  }
  return placement;
}

}  // namespace thermocomp::placement
