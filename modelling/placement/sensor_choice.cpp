#include "modelling/placement/sensor_choice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace thermocomp::placement {
namespace {

constexpr double far = std::numeric_limits<double>::infinity();
constexpr double gains_by = 1e-9;  ///< of the trace; less is rounding
constexpr int sweeps_max = 50;

/// The trace and what each block contributes to it, as blocks change.
class ErrorTrace {
 public:
  explicit ErrorTrace(const PlacementProblem& problem) : problem_(problem) {
    for (const Numbers& row : problem.block_matrix_um) {
      for (std::size_t b = 0; b < row.size(); ++b) {
        power_.resize(row.size(), 0.0);
        power_[b] +=
            problem.row_weight[static_cast<std::size_t>(&row - problem.block_matrix_um.data())] *
            row[b] * row[b];
      }
    }
    for (const Field& field : problem.used) {
      blocks_K_.push_back(block_means_K(problem, field.rise_K));
      Numbers error_um = block_displacement_um(problem, blocks_K_.back());
      for (std::size_t i = 0; i < error_um.size(); ++i) error_um[i] -= field.displacement_um[i];
      errors_um_.push_back(std::move(error_um));
    }
  }

  [[nodiscard]] double total() const {
    double sum = 0.0;
    for (const Numbers& error : errors_um_) {
      for (std::size_t i = 0; i < error.size(); ++i) {
        sum += problem_.row_weight[i] * error[i] * error[i];
      }
    }
    return sum;
  }

  [[nodiscard]] double rms_um() const {
    return std::sqrt(total() / static_cast<double>(problem_.used.size() * problem_.curves.size()));
  }

  struct Best {
    Index node{0};
    double change{far};  ///< of the trace
  };
  /// The best node of a block, all others as they are.
  [[nodiscard]] Best best_node(std::size_t block) const {
    // The trace changes by sum_f 2 x_f g_f + x_f^2 |P_b|^2 with x the change of the block.
    Numbers slope(errors_um_.size(), 0.0);
    for (std::size_t f = 0; f < errors_um_.size(); ++f) {
      for (std::size_t i = 0; i < problem_.rows(); ++i) {
        slope[f] += problem_.row_weight[i] * errors_um_[f][i] * problem_.block_matrix_um[i][block];
      }
    }
    Best best;
    for (const Index node : problem_.blocks[block].candidates) {
      double change = 0.0;
      for (std::size_t f = 0; f < slope.size(); ++f) {
        const double x = problem_.used[f].rise_K[node] - blocks_K_[f][block];
        change += x * (2.0 * slope[f] + x * power_[block]);
      }
      if (change < best.change) best = {node, change};
    }
    return best;
  }

  void set(std::size_t block, Index node) {
    for (std::size_t f = 0; f < errors_um_.size(); ++f) {
      const double x = problem_.used[f].rise_K[node] - blocks_K_[f][block];
      blocks_K_[f][block] += x;
      for (std::size_t i = 0; i < problem_.rows(); ++i) {
        errors_um_[f][i] += problem_.block_matrix_um[i][block] * x;
      }
    }
  }

 private:
  const PlacementProblem& problem_;
  Numbers power_;                  ///< |P_b|^2 by weights, shape (blocks)
  std::vector<Numbers> blocks_K_;  ///< shape (fields)(blocks)
  std::vector<Numbers> errors_um_;
};

}  // namespace

Index centroid_node(const PlacementProblem& problem, const BlockOfSensors& block) {
  Vec3 middle{};
  for (const Index node : block.nodes) middle = middle + problem.nodes_m[node];
  middle = (1.0 / static_cast<double>(block.nodes.size())) * middle;
  return *std::min_element(block.candidates.begin(), block.candidates.end(), [&](Index a, Index b) {
    return length(problem.nodes_m[a] - middle) < length(problem.nodes_m[b] - middle);
  });
}

std::vector<Index> place_at_centroids(const PlacementProblem& problem) {
  std::vector<Index> sensors;
  for (const BlockOfSensors& block : problem.blocks) {
    sensors.push_back(centroid_node(problem, block));
  }
  return sensors;
}

GreedyPlacement place_greedily(const PlacementProblem& problem) {
  GreedyPlacement placement;
  placement.sensors.resize(problem.blocks.size());
  ErrorTrace trace(problem);
  const auto put = [&](std::size_t block, Index node) {
    trace.set(block, node);
    placement.sensors[block] = node;
    placement.steps.push_back({problem.blocks[block].name, node, trace.rms_um()});
  };
  std::vector<bool> placed(problem.blocks.size(), false);
  for (std::size_t round = 0; round < placed.size(); ++round) {
    std::size_t best_block = 0;
    ErrorTrace::Best best;
    for (std::size_t block = 0; block < placed.size(); ++block) {
      if (placed[block]) continue;
      const ErrorTrace::Best found = trace.best_node(block);
      if (found.change < best.change) {
        best = found;
        best_block = block;
      }
    }
    placed[best_block] = true;
    put(best_block, best.node);
  }
  for (int sweep = 0; sweep < sweeps_max; ++sweep) {
    bool moved = false;
    for (std::size_t block = 0; block < placed.size(); ++block) {
      const ErrorTrace::Best found = trace.best_node(block);
      if (!(found.change < -gains_by * trace.total())) continue;
      put(block, found.node);
      moved = true;
    }
    if (!moved) break;
  }
  return placement;
}

std::vector<Index> place_at_random(const PlacementProblem& problem, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Index> sensors;
  for (const BlockOfSensors& block : problem.blocks) {
    // Not uniform_int_distribution, whose numbers hang on the library.
    sensors.push_back(block.candidates[random() % block.candidates.size()]);
  }
  return sensors;
}

}  // namespace thermocomp::placement
