#include <algorithm>

#include <Eigen/Dense>

#include "modelling/placement/sensor_choice.hpp"

namespace thermocomp::placement {
namespace {

constexpr double mode_least = 1e-8;  ///< of the greatest singular value

/// Modes of the used fields: shape (nodes, modes), orthonormal; at most one a block.
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

/// Pivots among nodes for which `free` is true; `taken(node)` says what a choice takes away.
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
