#include <array>
#include <cmath>

#include <Eigen/Dense>

#include "config/text/problems.hpp"
#include "estimator/checks.hpp"
#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/solve/locate.hpp"

namespace thermocomp::structure {
namespace {

/// Krylov shifts, from the steady state to changes within minutes.
constexpr std::array<double, 4> shifts_per_s{0.0, 1.0 / 14400.0, 1.0 / 2400.0, 1.0 / 400.0};
/// Shifts for changes of a film, joint or capacity.
constexpr std::array<double, 2> part_shifts_per_s{0.0, 1.0 / 2400.0};
constexpr double new_direction_least = 1e-7;
constexpr double um_per_m = 1e6;

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

Vector times(const SparseSymmetric& matrix, const Vector& x) {
  Vector y(x.size());
  matrix.multiply({x.data(), static_cast<std::size_t>(x.size())},
                  {y.data(), static_cast<std::size_t>(y.size())});
  return y;
}

Matrix times(const SparseSymmetric& matrix, const Matrix& x) {
  Matrix y(x.rows(), x.cols());
  for (Eigen::Index j = 0; j < x.cols(); ++j) y.col(j) = times(matrix, Vector(x.col(j)));
  return y;
}

std::vector<double> plain(const Vector& x) {
  return {x.data(), x.data() + x.size()};
}

std::vector<double> plain(const Matrix& x) {
  const Matrix transposed = x.transpose();  // row-major
  return {transposed.data(), transposed.data() + transposed.size()};
}

/// Fields orthonormal in the heat capacity.
class Basis {
 public:
  explicit Basis(const SparseSymmetric& capacity) : capacity_(capacity) {}

  void add(Vector field) {
    const double before = norm(field);
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < fields_.size(); ++i) {
        field -= weighted_[i].dot(field) * fields_[i];
      }
    }
    const double after = norm(field);
    if (!(after > new_direction_least * before)) return;
    fields_.push_back(field / after);
    weighted_.push_back(times(capacity_, fields_.back()));
  }

  [[nodiscard]] Matrix matrix() const {
    Matrix all(fields_.front().size(), static_cast<Eigen::Index>(fields_.size()));
    for (Eigen::Index j = 0; j < all.cols(); ++j) all.col(j) = fields_[static_cast<std::size_t>(j)];
    return all;
  }

 private:
  [[nodiscard]] double norm(const Vector& field) const {
    return std::sqrt(std::max(0.0, field.dot(times(capacity_, field))));
  }

  const SparseSymmetric& capacity_;
  std::vector<Vector> fields_;
  std::vector<Vector> weighted_;  ///< capacity times field
};

/// Matrices and inputs in the free unknowns. Each conduction has a capacity with its own pattern.
struct FreeModel {
  SparseSymmetric capacity;
  SparseSymmetric dry;
  SparseSymmetric capacity_flooded;
  SparseSymmetric flooded;
  std::vector<Vector> inputs;  ///< heats, then the room
  Vector coolant;
};

class Reducer {
 public:
  Reducer(const StructureSpec& spec, const Structure& structure, const HeatModel& heat)
      : spec_(spec), structure_(structure), heat_(heat), free_(free_model()) {}

  BodyReduction reduce(const Statics& statics, bool with_parts) {
    const auto sensitivities = statics.sensitivities(structure_.rows);
    std::vector<Vector> outputs;
    for (std::size_t i = 0; i < spec_.outputs.size(); ++i) {
      outputs.push_back(um_per_m * restricted(sensitivities[i]));
    }
    if (with_parts) find_parts();
    find_basis(outputs);
    BodyReduction reduction{{}, fields()};
    ReducedBody& body = reduction.body;
    const Matrix coolant_part = times(free_.flooded, basis_) - times(free_.dry, basis_);
    const Matrix coolant = basis_.transpose() * coolant_part;
    body.conductance = plain(Matrix(rates_.asDiagonal()));
    body.coolant_conductance = plain(Matrix(0.5 * (coolant + coolant.transpose())));
    body.room_inflow = states_of(free_.inputs.back());
    body.coolant_inflow = states_of(free_.coolant);
    body.one_degC = states_of(times(free_.capacity, Vector(Vector::Ones(basis_.rows()))));
    for (std::size_t i = 0; i < spec_.heats.size(); ++i) {
      const HeatSpec& heat = spec_.heats[i];
      body.sources.push_back({heat.name, heat.signal, heat.heat_W, heat.at, heat.exponent,
                              states_of(free_.inputs[i])});
    }
    add_sensors(body);
    for (std::size_t i = 0; i < spec_.outputs.size(); ++i) {
      body.outputs.push_back({spec_.outputs[i].name, states_of(outputs[i])});
    }
    add_guideways(sensitivities, body);
    if (with_parts) {
      add_couplings(reduction);
      add_capacities(body);
    }
    return reduction;
  }

 private:
  /// Guideway rows do not affect the basis, which contains the response to every input.
  void add_guideways(const std::vector<std::vector<double>>& sensitivities,
                     ReducedBody& body) const {
    std::size_t next = spec_.outputs.size();
    for (const GuidewayRows& guideway : spec_.guideways) {
      for (const auto& [output, direction] : guideway.outputs) {
        BodyGuideway& rows = body.guideways.emplace_back(
            BodyGuideway{guideway.name, guideway.axis, output, guideway.positions_mm, {}});
        for (std::size_t i = 0; i < guideway.places.size(); ++i)
          rows.rows.push_back(states_of(um_per_m * restricted(sensitivities[next++])));
      }
    }
  }

  [[nodiscard]] std::vector<std::vector<double>> fields() const {
    std::vector<std::vector<double>> all;
    for (const auto& field : basis_.colwise())
      all.push_back(
          heat_.reduction.expanded({field.data(), static_cast<std::size_t>(field.size())}));
    return all;
  }

  /// A coupling is strength w w'; its projection is strength v v' with v = V' w.
  void add_couplings(BodyReduction& reduction) const {
    ReducedBody& body = reduction.body;
    for (const NamedCouplings& named : heat_.named) {
      Matrix matrix = Matrix::Zero(basis_.cols(), basis_.cols());
      Vector inflow = Vector::Zero(basis_.cols());
      for (const Coupling& coupling : named.couplings) {
        Vector at = Vector::Zero(basis_.cols());
        for (std::size_t i = 0; i < coupling.count; ++i)
          for (Eigen::Index j = 0; j < at.size(); ++j)
            at[j] += coupling.weight[i] *
                     reduction.fields[static_cast<std::size_t>(j)][coupling.nodes[i]];
        matrix += coupling.strength[0] * at * at.transpose();
        inflow += coupling.strength[0] * at;
      }
      const bool film = named.kind != BodyPartKind::joint;
      body.parts.push_back({named.name, named.kind,
                            plain(Matrix(0.5 * (matrix + matrix.transpose()))),
                            film ? plain(inflow) : std::vector<double>()});
    }
  }

  void add_capacities(ReducedBody& body) const {
    for (std::size_t part = 0; part < capacities_.size(); ++part) {
      const Matrix matrix = basis_.transpose() * times(capacities_[part], basis_);
      body.parts.push_back({structure_.mesh.part_names[part],
                            BodyPartKind::capacity,
                            plain(Matrix(0.5 * (matrix + matrix.transpose()))),
                            {}});
    }
  }

  /// A change of a strength first changes a uniform flow: over a film, across a joint, into a part.
  /// The basis must contain the fields of such flows, or a weak joint could not open.
  void find_parts() {
    const Mesh& mesh = structure_.mesh;
    for (const NamedCouplings& named : heat_.named) {
      std::vector<double> flow(mesh.nodes_m.size(), 0.0);
      for (const Coupling& coupling : named.couplings)
        for (std::size_t i = 0; i < coupling.count; ++i)
          flow[coupling.nodes[i]] += coupling.strength[0] * coupling.weight[i];
      flows_.push_back(restricted(flow));
    }
    for (std::size_t part = 0; part < mesh.part_names.size(); ++part) {
      std::vector<Material> alone = structure_.material_of_part;
      for (std::size_t other = 0; other < alone.size(); ++other)
        if (other != part) alone[other].density_kg_per_m3 = 0.0;
      capacities_.push_back(heat_.reduction.reduced(heat_matrices(mesh, alone, {}).capacity));
      flows_.push_back(times(capacities_.back(), Vector(Vector::Ones(flows_.front().size()))));
    }
  }

  [[nodiscard]] Vector restricted(std::span<const double> full) const {
    Vector result(heat_.reduction.free_size());
    heat_.reduction.restrict_to_free(full,
                                     {result.data(), static_cast<std::size_t>(result.size())});
    return result;
  }

  [[nodiscard]] FreeModel free_model() const {
    const Mesh& mesh = structure_.mesh;
    const HeatMatrices dry = heat_matrices(mesh, structure_.material_of_part, heat_.dry);
    const HeatMatrices flooded = heat_matrices(mesh, structure_.material_of_part, heat_.flooded);
    FreeModel model{heat_.reduction.reduced(dry.capacity),
                    heat_.reduction.reduced(dry.conduction),
                    heat_.reduction.reduced(flooded.capacity),
                    heat_.reduction.reduced(flooded.conduction),
                    {},
                    restricted(heat_.coolant_W_per_K)};
    for (const auto& share : heat_.shares) model.inputs.push_back(restricted(share));
    model.inputs.push_back(restricted(heat_.room_W_per_K));
    return model;
  }

  static void add_responses(const SparseSymmetric& conduction, const SparseSymmetric& capacity,
                            double shift, const std::vector<Vector>& inputs, Basis& basis) {
    const Cholesky factor(combination(1.0, conduction, shift, capacity));
    for (Vector response : inputs) {
      factor.solve({response.data(), static_cast<std::size_t>(response.size())});
      basis.add(std::move(response));
    }
  }

  void find_basis(const std::vector<Vector>& outputs) {
    Basis basis(free_.capacity);
    basis.add(Vector::Ones(heat_.reduction.free_size()));
    const bool wet = free_.coolant.squaredNorm() > 0.0;
    std::vector<Vector> with_coolant = free_.inputs;
    with_coolant.push_back(free_.coolant);
    for (const double shift : shifts_per_s) {
      add_responses(free_.dry, free_.capacity, shift, free_.inputs, basis);
      add_responses(free_.dry, free_.capacity, shift, outputs, basis);
      if (!wet) continue;
      add_responses(free_.flooded, free_.capacity_flooded, shift, with_coolant, basis);
      add_responses(free_.flooded, free_.capacity_flooded, shift, outputs, basis);
    }
    for (const double shift : part_shifts_per_s)
      if (!flows_.empty()) add_responses(free_.dry, free_.capacity, shift, flows_, basis);
    basis_ = basis.matrix();
    const Matrix conduction = basis_.transpose() * times(free_.dry, basis_);
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(0.5 * (conduction + conduction.transpose()));
    THERMOCOMP_ENSURE(solver.info() == Eigen::Success);
    rates_ = solver.eigenvalues();
    basis_ = basis_ * solver.eigenvectors();
    // Fixes the sign of each mode independently of rounding, so that files can be compared.
    for (Eigen::Index j = 0; j < basis_.cols(); ++j) {
      double most = 0.0;
      for (const Vector& input : free_.inputs) {
        const double into = basis_.col(j).dot(input) / input.cwiseAbs().sum();
        if (std::fabs(into) > std::fabs(most) * (1.0 + 1e-6)) most = into;
      }
      if (most < 0.0) basis_.col(j) *= -1.0;
    }
  }

  [[nodiscard]] std::vector<double> states_of(const Vector& free) const {
    return plain(Vector(basis_.transpose() * free));
  }

  void add_sensors(ReducedBody& body) const {
    std::vector<Problem> problems;
    for (const SensorSpec& sensor : spec_.sensors) {
      const PlaceSpec& place = sensor.place;
      const auto found = locate_in_part(structure_.mesh, place.part, place.at_m.front(),
                                        place.tolerance_m + coincidence_m(structure_.mesh));
      if (!found) {
        problems.push_back({spec_.file.string(), place.origin.line, place.origin.key, sensor.name,
                            "the point is outside its part, further away than tolerance_mm"});
        continue;
      }
      std::vector<double> full(structure_.mesh.nodes_m.size(), 0.0);
      for (const Weighted& node : found->nodes) full[node.node] += node.weight;
      body.sensors.push_back({sensor.name, states_of(restricted(full))});
    }
    if (!problems.empty()) throw ConfigurationError(std::move(problems));
  }

  const StructureSpec& spec_;
  const Structure& structure_;
  const HeatModel& heat_;
  FreeModel free_;
  std::vector<Vector> flows_;                ///< of films, joints and parts, if requested
  std::vector<SparseSymmetric> capacities_;  ///< of each part alone
  Matrix basis_;                             ///< V
  Vector rates_;                             ///< of V^T L V
};

}  // namespace

BodyReduction reduce_body(const StructureSpec& spec, const Structure& structure,
                          const HeatModel& heat, const Statics& statics, bool with_parts) {
  std::vector<Problem> problems;
  const auto problem = [&](const char* key, const char* rule) {
    problems.push_back({spec.file.string(), 0, key, "", rule});
  };
  if (spec.sensors.empty()) problem("sensor", "a body for the simulator needs [[sensor]] points");
  if (spec.heats.empty()) problem("heat", "a body for the simulator needs a [[heat]]");
  if (spec.convections.empty()) {
    problem("convection", "a body for the simulator needs a [[convection]]");
  }
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
  return Reducer(spec, structure, heat).reduce(statics, with_parts);
}

}  // namespace thermocomp::structure
