#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "modelling/structure/solve/statics.hpp"

namespace thermocomp::structure {
namespace {

constexpr double held_of_largest = 1e-9;
constexpr Index rigid_motions = 6;

/// Rigid motions of every body: three translations and three turns about its middle, the turns
/// scaled by its size so that all six are alike in magnitude.
class RigidMotions {
 public:
  explicit RigidMotions(const Mesh& mesh) : mesh_(mesh), body_of_node_(bodies_of_nodes(mesh)) {
    std::vector<std::vector<Vec3>> points;
    for (Index node = 0; node < body_of_node_.size(); ++node) {
      const Index body = body_of_node_[node];
      if (body == no_part) continue;
      if (body >= points.size()) points.resize(body + 1);
      points[body].push_back(mesh.nodes_m[node]);
    }
    for (const std::vector<Vec3>& body : points) {
      const Box box = bounds_of(body);
      middle_m_.push_back(0.5 * (box.low_m + box.high_m));
      scale_per_m_.push_back(2.0 / box.diagonal_m());
    }
  }

  [[nodiscard]] std::size_t bodies() const { return middle_m_.size(); }
  [[nodiscard]] Index body_of(Index node) const { return body_of_node_[node]; }

  /// Adds weight times displacement `component` of the node to a row over all motions.
  void add(Eigen::VectorXd& row, Index node, std::size_t component, double weight) const {
    const Index body = body_of_node_[node];
    if (body == no_part) return;
    const Vec3 arm = scale_per_m_[body] * (mesh_.nodes_m[node] - middle_m_[body]);
    row[motion(body, component)] += weight;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vec3 turn{};
      turn[axis] = 1.0;
      row[motion(body, 3 + axis)] += weight * cross(turn, arm)[component];
    }
  }

  [[nodiscard]] static Eigen::Index motion(std::size_t body, std::size_t which) {
    return static_cast<Eigen::Index>(body * rigid_motions + which);
  }

 private:
  const Mesh& mesh_;
  std::vector<Index> body_of_node_;
  std::vector<Vec3> middle_m_;
  std::vector<double> scale_per_m_;
};

/// Sum of row row^T over everything that holds: nothing is resisted in its null space.
Eigen::MatrixXd resistance(const RigidMotions& motions, Index nodes, const Reduction& reduction,
                           std::span<const Coupling> couplings) {
  const auto size = static_cast<Eigen::Index>(motions.bodies() * rigid_motions);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd row(size);
  const auto take = [&] { sum.selfadjointView<Eigen::Lower>().rankUpdate(row); };
  for (Index node = 0; node < nodes; ++node) {
    for (Index c = 0; c < 3; ++c) {
      const std::vector<Weighted>& masters = reduction.masters_of(node);
      if (!reduction.is_held(node, c) && masters.empty()) continue;
      row.setZero();
      motions.add(row, node, c, 1.0);
      if (!reduction.is_held(node, c)) {
        for (const Weighted& master : masters) motions.add(row, master.node, c, -master.weight);
      }
      take();
    }
  }
  for (const Coupling& coupling : couplings) {
    for (std::size_t c = 0; c < 3; ++c) {
      if (!(coupling.strength[c] > 0.0)) continue;
      row.setZero();
      for (std::size_t i = 0; i < coupling.count; ++i) {
        motions.add(row, coupling.nodes[i], c, coupling.weight[i]);
      }
      take();
    }
  }
  return sum.selfadjointView<Eigen::Lower>();
}

std::string part_of_body(const Mesh& mesh, const RigidMotions& motions, Index body) {
  const std::vector<Index> parts = parts_of_nodes(mesh);
  for (Index node = 0; node < parts.size(); ++node) {
    if (motions.body_of(node) == body) return mesh.part_names[parts[node]];
  }
  return "?";
}

}  // namespace

std::vector<std::string> free_motions(const Mesh& mesh, const Reduction& reduction,
                                      std::span<const Coupling> couplings) {
  const RigidMotions motions(mesh);
  const auto nodes = static_cast<Index>(mesh.nodes_m.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      resistance(motions, nodes, reduction, couplings));
  const double largest = solver.eigenvalues().maxCoeff();
  constexpr std::array<const char*, rigid_motions> names{"moving along x",  "moving along y",
                                                         "moving along z",  "turning about x",
                                                         "turning about y", "turning about z"};
  std::vector<std::string> lines;
  for (Eigen::Index i = 0; i < solver.eigenvalues().size(); ++i) {
    if (solver.eigenvalues()[i] > held_of_largest * largest) break;
    Eigen::Index strongest = 0;
    solver.eigenvectors().col(i).cwiseAbs().maxCoeff(&strongest);
    const auto body = static_cast<Index>(strongest / rigid_motions);
    const auto which = static_cast<std::size_t>(strongest % rigid_motions);
    std::string line = "part " + part_of_body(mesh, motions, body);
    lines.push_back(line.append(" is not held against ").append(names[which]));
  }
  std::sort(lines.begin(), lines.end());
  lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
  return lines;
}

}  // namespace thermocomp::structure
