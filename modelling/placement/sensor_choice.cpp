#include "modelling/placement/sensor_choice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <Eigen/Dense>

namespace thermocomp::placement {

namespace {

constexpr double gains_by = 1e-9;  ///< share of the trace; less is rounding
constexpr int sweeps_max = 50;

/// Trace of the error covariance, updated when a block changes.
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
    double change{std::numeric_limits<double>::infinity()};  ///< change of the trace
  };
  [[nodiscard]] Best best_node(std::size_t block) const {
    // The trace changes by sum_f 2 x_f g_f + x_f^2 |P_b|^2; x is the block's change.
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
  Numbers power_;                  ///< weighted |P_b|^2, shape (blocks)
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
    // Not uniform_int_distribution, whose numbers depend on the library.
    sensors.push_back(block.candidates[random() % block.candidates.size()]);
  }
  return sensors;
}

namespace {

constexpr double mode_least = 1e-8;  ///< share of the largest singular value

/// Modes of the used fields: shape (nodes, modes), orthonormal; at most one per block.
Eigen::MatrixXd modes_of(const PlacementProblem& problem) {
  const auto nodes = static_cast<Eigen::Index>(problem.nodes_m.size());
  const auto count = static_cast<Eigen::Index>(problem.used.size());
  Eigen::MatrixXd fields(nodes, count);
  for (Eigen::Index f = 0; f < count; ++f) {
    fields.col(f) = Eigen::Map<const Eigen::VectorXd>(
        problem.used[static_cast<std::size_t>(f)].rise_K.data(), nodes);
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(fields, Eigen::ComputeThinU);
  const auto& values = svd.singularValues();
  Eigen::Index modes = 0;
  while (modes < count && modes < static_cast<Eigen::Index>(problem.blocks.size()) &&
         values[modes] > mode_least * values[0]) {
    ++modes;
  }
  return svd.matrixU().leftCols(modes);
}

/// Pivots among nodes for which `free` is true; `taken(node)` lists what a choice excludes.
template <class Taken>
std::vector<Index> pivots_of(const Eigen::MatrixXd& modes, std::vector<bool> free,
                             const Taken& taken) {
  Eigen::MatrixXd rest = modes;  // rows: nodes
  std::vector<Index> pivots;
  for (Eigen::Index step = 0; step < modes.cols(); ++step) {
    double most = 0.0;
    Index pivot = 0;
    for (Index node = 0; node < free.size(); ++node) {
      const double size = free[node] ? rest.row(node).squaredNorm() : 0.0;
      if (!(size > most)) continue;
      most = size;
      pivot = node;
    }
    if (!(most > mode_least * mode_least)) break;
    pivots.push_back(pivot);
    const Eigen::RowVectorXd direction = rest.row(pivot) / std::sqrt(most);
    rest -= (rest * direction.transpose()) * direction;
    taken(pivot, free);
  }
  return pivots;
}

}  // namespace

std::vector<Index> place_by_qr(const PlacementProblem& problem) {
  std::vector<std::size_t> block_of(problem.nodes_m.size(), 0);
  std::vector<bool> free(problem.nodes_m.size(), false);
  for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
    for (const Index node : problem.blocks[b].candidates) {
      block_of[node] = b;
      free[node] = true;
    }
  }
  std::vector<Index> sensors = place_at_centroids(problem);
  const auto take_block = [&](Index pivot, std::vector<bool>& still_free) {
    for (const Index node : problem.blocks[block_of[pivot]].candidates) still_free[node] = false;
  };
  for (const Index pivot : pivots_of(modes_of(problem), free, take_block)) {
    sensors[block_of[pivot]] = pivot;
  }
  return sensors;
}

Reconstruction reconstruct_by_qr(const PlacementProblem& problem) {
  Reconstruction result;
  const Eigen::MatrixXd modes = modes_of(problem);
  std::vector<bool> free(problem.nodes_m.size(), false);
  for (const BlockOfSensors& block : problem.blocks) {
    for (const Index node : block.candidates) free[node] = true;
  }
  result.sensors = pivots_of(
      modes, free, [](Index pivot, std::vector<bool>& still_free) { still_free[pivot] = false; });
  for (const Index node : result.sensors) {
    Numbers& row = result.modes_at_sensors.emplace_back();
    for (Eigen::Index m = 0; m < modes.cols(); ++m) row.push_back(modes(node, m));
  }
  for (Eigen::Index m = 0; m < modes.cols(); ++m) {
    Numbers& rows_um = result.modes_um.emplace_back();
    for (const Numbers& row : problem.sensitivity_um) {
      rows_um.push_back(
          Eigen::Map<const Eigen::VectorXd>(row.data(), modes.rows()).dot(modes.col(m)));
    }
  }
  return result;
}

std::vector<Numbers> estimates_um(const PlacementProblem& problem, const std::vector<Field>& fields,
                                  const Reconstruction& reconstruction) {
  const auto sensors = static_cast<Eigen::Index>(reconstruction.sensors.size());
  const auto modes = static_cast<Eigen::Index>(reconstruction.modes_um.size());
  Eigen::MatrixXd at_sensors(sensors, modes);
  for (Eigen::Index s = 0; s < sensors; ++s) {
    for (Eigen::Index m = 0; m < modes; ++m) {
      at_sensors(s, m) =
          reconstruction.modes_at_sensors[static_cast<std::size_t>(s)][static_cast<std::size_t>(m)];
    }
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(at_sensors);
  std::vector<Numbers> estimates;
  for (const Field& field : fields) {
    Eigen::VectorXd readings_K(sensors);
    for (Eigen::Index s = 0; s < sensors; ++s) {
      readings_K[s] = field.rise_K[reconstruction.sensors[static_cast<std::size_t>(s)]];
    }
    const Eigen::VectorXd amplitudes = solver.solve(readings_K);
    Numbers rows_um(problem.rows(), 0.0);
    for (Eigen::Index m = 0; m < modes; ++m) {
      for (std::size_t i = 0; i < rows_um.size(); ++i) {
        rows_um[i] += amplitudes[m] * reconstruction.modes_um[static_cast<std::size_t>(m)][i];
      }
    }
    estimates.push_back(std::move(rows_um));
  }
  return estimates;
}

}  // namespace thermocomp::placement
