/// Other methods of choosing one node per block: reference, candidates and start values.
#pragma once

#include <cstdint>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// The candidate nearest to the centre of the block's nodes.
[[nodiscard]] Index centroid_node(const PlacementProblem& problem, const BlockOfSensors& block);
[[nodiscard]] std::vector<Index> place_at_centroids(const PlacementProblem& problem);

struct GreedyStep {
  std::string block;
  Index node{0};
  double error_um{0.0};  ///< RMS over the used fields after this step
};
struct GreedyPlacement {
  std::vector<GreedyStep> steps;
  std::vector<Index> sensors;
};

/// Minimises the trace of the outputs' error covariance (about zero) over the used fields, weighted
/// sum_f |P1 theta_sensors,f - delta1,f|^2. Every block starts with its mean; one sensor after
/// another is placed where the trace falls most; then sensors are moved until none improves it.
[[nodiscard]] GreedyPlacement place_greedily(const PlacementProblem& problem);

/// QR with column pivoting of the fields' modes: each pivot is the node with the largest part not
/// yet explained by the chosen ones. One node per block; blocks beyond the number of modes use
/// their centroid.
/// Source: K. Manohar et al., Data-driven sparse sensor placement for reconstruction, 2018.
[[nodiscard]] std::vector<Index> place_by_qr(const PlacementProblem& problem);

/// Likewise without blocks and with that publication's estimate: the modes are fitted to the
/// readings. @return estimates for fields, shape (fields)(rows) [um]
struct Reconstruction {
  std::vector<Index> sensors;
  std::vector<Numbers> modes_at_sensors;  ///< shape (sensors)(modes)
  std::vector<Numbers> modes_um;          ///< displacement of each mode, shape (modes)(rows)
};
[[nodiscard]] Reconstruction reconstruct_by_qr(const PlacementProblem& problem);
[[nodiscard]] std::vector<Numbers> estimates_um(const PlacementProblem& problem,
                                                const std::vector<Field>& fields,
                                                const Reconstruction& reconstruction);

/// One random candidate per block, reproducible by the seed.
[[nodiscard]] std::vector<Index> place_at_random(const PlacementProblem& problem,
                                                 std::uint64_t seed);

}  // namespace thermocomp::placement
