#include "modelling/structure/solve/conduction.hpp"

#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp::structure {
namespace {

const double gamma_fraction = 2.0 - std::sqrt(2.0);
/// Weight of the end's rate in both stages, per step.
const double stage_weight = gamma_fraction / 2.0;

std::vector<double> product(const SparseSymmetric& matrix, std::span<const double> x) {
  std::vector<double> y(x.size());
  matrix.multiply(x, y);
  return y;
}

}  // namespace

Conduction::Conduction(const Mesh& mesh, std::span<const Material> material_of_part,
                       const Reduction& reduction, std::span<const Coupling> couplings)
    : reduction_(reduction), full_(heat_matrices(mesh, material_of_part, couplings)) {}

std::vector<double> Conduction::steady_degC(const HeatInput& input) const {
  const std::vector<double> given = reduction_.given(input.held_degC);
  std::vector<double> load_W = product(full_.conduction, given);
  for (std::size_t i = 0; i < load_W.size(); ++i) load_W[i] = input.load_W[i] - load_W[i];
  std::vector<double> free(reduction_.free_size());
  reduction_.restrict_to_free(load_W, free);
  const Cholesky factor(reduction_.reduced(full_.conduction));
  factor.solve(free);
  std::vector<double> temps_degC = reduction_.expanded(free);
  for (std::size_t i = 0; i < temps_degC.size(); ++i) temps_degC[i] += given[i];
  return temps_degC;
}

double Conduction::energy_J(std::span<const double> temps_degC) const {
  double sum = 0.0;
  for (const double value : product(full_.capacity, temps_degC)) sum += value;
  return sum;
}

TransientConduction::TransientConduction(const Conduction& conduction, double step_s,
                                         std::span<const double> initial_degC)
    : conduction_(conduction),
      step_s_(step_s),
      temps_degC_(initial_degC.begin(), initial_degC.end()),
      factor_(conduction.reduction_.reduced(combination(
          1.0, conduction.full_.capacity, stage_weight * step_s, conduction.full_.conduction))) {
  THERMOCOMP_ENSURE(step_s > 0.0);
}

/// Solves C T + w L T = stored + w q, with T split into free and given values.
void TransientConduction::solve_stage(std::span<const double> stored, const HeatInput& input,
                                      double weight_s) {
  const Reduction& reduction = conduction_.reduction_;
  const std::vector<double> given = reduction.given(input.held_degC);
  const std::vector<double> given_stores = product(conduction_.full_.capacity, given);
  const std::vector<double> given_conducts = product(conduction_.full_.conduction, given);
  std::vector<double> right(stored.begin(), stored.end());
  for (std::size_t i = 0; i < right.size(); ++i) {
    right[i] += weight_s * (input.load_W[i] - given_conducts[i]) - given_stores[i];
  }
  std::vector<double> free(reduction.free_size());
  reduction.restrict_to_free(right, free);
  factor_.solve(free);
  temps_degC_ = reduction.expanded(free);
  for (std::size_t i = 0; i < temps_degC_.size(); ++i) temps_degC_[i] += given[i];
}

void TransientConduction::step(const InputAt& input_at) {
  const double begin_s = time_s_;
  const double middle_s = begin_s + 0.5 * step_s_;
  const double weight_s = stage_weight * step_s_;
  const std::size_t nodes = temps_degC_.size();
  HeatInput input{std::vector<double>(nodes), std::vector<double>(nodes)};

  const std::vector<double> begin_degC = temps_degC_;
  input_at(begin_s, middle_s, input);
  const std::vector<double> conducted = product(conduction_.full_.conduction, begin_degC);
  std::vector<double> stored = product(conduction_.full_.capacity, begin_degC);
  for (std::size_t i = 0; i < nodes; ++i) stored[i] += weight_s * (input.load_W[i] - conducted[i]);
  input_at(begin_s + gamma_fraction * step_s_, middle_s, input);
  solve_stage(stored, input, weight_s);

  const double scale = 1.0 / (gamma_fraction * (2.0 - gamma_fraction));
  const double back = (1.0 - gamma_fraction) * (1.0 - gamma_fraction);
  std::vector<double> mixed(nodes);
  for (std::size_t i = 0; i < nodes; ++i) {
    mixed[i] = scale * (temps_degC_[i] - back * begin_degC[i]);
  }
  // Multiplied, since a sum of steps would accumulate rounding.
  time_s_ = static_cast<double>(++steps_) * step_s_;
  input_at(time_s_, middle_s, input);
  solve_stage(product(conduction_.full_.capacity, mixed), input, weight_s);
}

}  // namespace thermocomp::structure
