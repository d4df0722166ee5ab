#include "modelling/structure/solve/statics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <Eigen/Eigenvalues>

#include "modelling/structure/solve/linear_solver.hpp"

namespace thermocomp::structure {

namespace {

constexpr std::size_t right_sides_at_once = 16;

class CholmodSolver : public LinearSolver {
 public:
  explicit CholmodSolver(const SparseSymmetric& matrix) : factor_(matrix) {}
  void solve(std::span<double> right_sides) const override { factor_.solve(right_sides); }
  [[nodiscard]] std::string report() const override {
    char text[128];
    std::snprintf(text, sizeof text,
                  "factor %.0f MB\nreciprocal condition of the stiffness (estimate): %.2g\n",
                  factor_.factor_MB(), factor_.reciprocal_condition());
    return text;
  }

 private:
  Cholesky factor_;
};

std::unique_ptr<LinearSolver> make_solver(const SparseSymmetric& matrix, const Mesh& mesh,
                                          const Reduction& reduction, const SolverChoice& choice) {
  if (choice.backend == Backend::cholmod) return std::make_unique<CholmodSolver>(matrix);
  return std::make_unique<PetscSolver>(matrix, mesh, reduction, choice.ranks);
}

}  // namespace

void Functional::add(std::span<const Weighted> point, const Vec3& direction) {
  for (const Weighted& node : point) entries.push_back({node.node, node.weight * direction});
}

double Functional::of(std::span<const double> displacement_m) const {
  double sum = 0.0;
  for (const Entry& entry : entries) {
    const double* at = &displacement_m[3 * std::size_t{entry.node}];
    sum += dot(entry.weight, {at[0], at[1], at[2]});
  }
  return sum;
}

Statics::Statics(const Mesh& mesh, std::span<const Material> material_of_part,
                 const Reduction& reduction, std::span<const Coupling> couplings,
                 const SolverChoice& choice)
    : mesh_(mesh),
      material_of_part_(material_of_part),
      reduction_(reduction),
      solver_(make_solver(reduction.reduced(stiffness_matrix(mesh, material_of_part, couplings)),
                          mesh, reduction, choice)) {}

std::vector<double> Statics::displacement_m(std::span<const double> rise_K) const {
  return displacement_under_m(thermal_load(mesh_, material_of_part_, rise_K));
}

std::vector<double> Statics::displacement_under_m(std::span<const double> force_N) const {
  std::vector<double> free(reduction_.free_size());
  reduction_.restrict_to_free(force_N, free);
  solver_->solve(free);
  return reduction_.expanded(free);
}

std::vector<std::vector<double>> Statics::sensitivities(std::span<const Functional> outputs) const {
  const std::size_t size = reduction_.free_size();
  std::vector<std::vector<double>> rows;
  while (rows.size() < outputs.size()) {
    const std::size_t first = rows.size();
    const std::size_t count = std::min(right_sides_at_once, outputs.size() - first);
    std::vector<double> sides(count * size);
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<double> full(reduction_.full_size(), 0.0);
      for (const Functional::Entry& entry : outputs[first + i].entries) {
        for (std::size_t c = 0; c < 3; ++c) {
          full[3 * std::size_t{entry.node} + c] += entry.weight[c];
        }
      }
      reduction_.restrict_to_free(full, {&sides[i * size], size});
    }
    solver_->solve(sides);
    for (std::size_t i = 0; i < count; ++i) {
      const auto adjoint = reduction_.expanded({&sides[i * size], size});
      rows.push_back(thermal_load_transposed(mesh_, material_of_part_, adjoint));
    }
  }
  return rows;
}

std::vector<Stress> nodal_stresses_Pa(const Mesh& mesh, std::span<const Material> material_of_part,
                                      std::span<const double> displacement_m,
                                      std::span<const double> rise_K) {
  const std::vector<Index> part_of_node = parts_of_nodes(mesh);
  std::vector<Stress> stress(mesh.nodes_m.size());
  std::vector<double> count(mesh.nodes_m.size(), 0.0);
  for (const Element& element : mesh.elements) {
    const Material& material = material_of_part[element.part];
    const double nu = material.poisson_ratio;
    const double mu = material.youngs_modulus_Pa / (2.0 * (1.0 + nu));
    const double lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
    const ShapeInfo& info = shape_info(element.shape);
    const auto nodes = mesh.nodes_of(element);
    const NodeCoordinates at = coordinates_of(mesh, nodes);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (part_of_node[nodes[i]] != element.part) continue;
      const Vec3& local = info.node_locals[i];
      const Gradients g =
          gradients_at({at.data(), nodes.size()}, {local, 1.0, shape_values(element.shape, local)});
      std::array<Vec3, 3> slope{};  // derivative of displacement c by coordinate d
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        for (std::size_t c = 0; c < 3; ++c) {
          slope[c] = slope[c] + displacement_m[3 * std::size_t{nodes[a]} + c] * g.gradient[a];
        }
      }
      const double thermal = material.expansion_per_K * rise_K[nodes[i]];
      const double volumetric = slope[0][0] + slope[1][1] + slope[2][2] - 3.0 * thermal;
      Stress& sum = stress[nodes[i]];
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t next = (c + 1) % 3;
        sum[c] += lambda * volumetric + 2.0 * mu * (slope[c][c] - thermal);
        sum[3 + c] += mu * (slope[c][next] + slope[next][c]);
      }
      count[nodes[i]] += 1.0;
    }
  }
  for (std::size_t node = 0; node < stress.size(); ++node) {
    for (double& component : stress[node]) component /= std::max(count[node], 1.0);
  }
  return stress;
}

namespace {

constexpr double held_of_largest = 1e-9;
constexpr Index rigid_motions = 6;

/// Rigid motions of every body: translations and rotations about its centre, scaled by its size.
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

/// Sum of row row^T over all constraints; its null space contains the free motions.
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
    lines.push_back(line.append(" is not restrained against ").append(names[which]));
  }
  std::sort(lines.begin(), lines.end());
  lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
  return lines;
}

}  // namespace thermocomp::structure
