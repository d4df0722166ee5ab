#include "estimator/sensing/neighbour_check.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Cholesky>

#include "estimator/checks.hpp"

namespace thermocomp {

std::vector<double> precision_per_K2(const ThermalModel& model) {
  using Matrix = Eigen::MatrixXd;
  require(model.covariance_K2.size() == model.inputs.size(), "covariance.matrix_K2",
          static_cast<double>(model.covariance_K2.size()), "must have one row an input");
  require(model.inputs.size() <= covariance_inputs_max, "covariance.matrix_K2",
          static_cast<double>(model.inputs.size()), "has more inputs than can be estimated");
  model.covariance_growth.validate(model.inputs.size());
  const double noise_K = model.covariance_growth.noise_K;
  const auto n = static_cast<Eigen::Index>(model.inputs.size());
  Matrix covariance_K2(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      covariance_K2(i, j) =
          model.covariance_K2[static_cast<std::size_t>(i)].at(static_cast<std::size_t>(j));
  // Rounding of large numbers may leave the file's matrix slightly negative.
  const double rounding_K2 = 1e-8 * static_cast<double>(n) * covariance_K2.cwiseAbs().maxCoeff();
  covariance_K2.diagonal().array() += std::max(noise_K * noise_K, rounding_K2);
  const Eigen::LLT<Matrix> llt(covariance_K2);
  if (llt.info() != Eigen::Success)
    throw InvalidValue("covariance.matrix_K2", std::to_string(n) + " rows",
                       "must be positive semidefinite");
  const Matrix inverse = llt.solve(Matrix::Identity(n, n));
  std::vector<double> flat;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) flat.push_back(0.5 * (inverse(i, j) + inverse(j, i)));
  return flat;
}

double grown(double age_s, double time_s) noexcept {
  if (!(time_s > 0)) return age_s > 0 ? 1.0 : 0.0;
  return -std::expm1(-age_s / time_s);
}

double drift_factor(const CovarianceGrowth& growth, std::size_t input) noexcept {
  return growth.drift_factor.empty() ? drift_factor_default : growth.drift_factor[input];
}

double scatter_factor(const CovarianceGrowth& growth, std::size_t input) noexcept {
  return growth.scatter_factor.empty() ? 0.0 : growth.scatter_factor[input];
}

namespace {

/// Smallest standard deviation of a thermocouple over hours, whatever the record's matrix gives.
constexpr double floor_K = 0.1;
/// A remainder below this share of the limit is explained.
constexpr double clean_share = 0.75;

}  // namespace

NeighbourCheck::NeighbourCheck(const ThermalModel& model)
    : inputs_(model.inputs.size()),
      growth_(model.covariance_growth),
      precision_per_K2_(precision_per_K2(model)),
      present_(inputs_, 0),
      change_K_(inputs_, 0.0),
      left_(inputs_ * inputs_, 0.0),
      y_(inputs_, 0.0),
      motions_(inputs_, 0.0) {
  for (std::size_t i = 0; i < inputs_; ++i)
    change_sd_K_.push_back(
        std::sqrt(2.0 * (model.covariance_K2[i][i] + growth_.noise_K * growth_.noise_K)));
}

void NeighbourCheck::prepare(std::span<const double> change_K) noexcept {
  THERMOCOMP_ENSURE(change_K.size() == inputs_);
  std::copy(precision_per_K2_.begin(), precision_per_K2_.end(), left_.begin());
  std::fill(present_.begin(), present_.end(), std::uint8_t{1});
  present_count_ = inputs_;
  for (std::size_t i = 0; i < inputs_; ++i) {
    change_K_[i] = change_K[i];
    if (!std::isfinite(change_K[i])) leave_out(i);
  }
  for (std::size_t i = 0; i < inputs_; ++i) {
    y_[i] = 0.0;
    if (present_[i] == 0) continue;
    for (std::size_t k = 0; k < inputs_; ++k)
      if (present_[k] != 0) y_[i] += left_[at(i, k)] * change_K_[k];
  }
}

/// Precision of the other inputs without this one.
void NeighbourCheck::leave_out(std::size_t input) noexcept {
  present_[input] = 0;
  --present_count_;
  const double pivot = left_[at(input, input)];
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (present_[i] == 0) continue;
    const double share = left_[at(i, input)] / pivot;
    y_[i] -= share * y_[input];
    for (std::size_t k = 0; k < inputs_; ++k)
      if (present_[k] != 0) left_[at(i, k)] -= share * left_[at(input, k)];
  }
}

double NeighbourCheck::motion() noexcept {
  std::size_t count = 0;
  for (std::size_t i = 0; i < inputs_; ++i)
    if (present_[i] != 0) motions_[count++] = std::abs(change_K_[i]) / change_sd_K_[i];
  const auto middle = motions_.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(motions_.begin(), middle, motions_.begin() + static_cast<std::ptrdiff_t>(count));
  return std::max(1.0, *middle);
}

double NeighbourCheck::variance_K2(std::size_t input, double precision) const noexcept {
  const double drift = drift_factor(growth_, input);
  const double scatter = scatter_factor(growth_, input);
  const double growth = drift * drift * grown(asked_.age_s, growth_.drift_time_s) +
                        scatter * scatter * grown(asked_.age_s, growth_.scatter_time_s);
  const double change_K2 = 2.0 * growth_.noise_K * growth_.noise_K + growth / precision;
  return asked_.share * amplified_ * change_K2 + floor_K * floor_K;
}

double NeighbourCheck::score(double y, double precision, std::size_t input) const noexcept {
  // Rounding may cancel the precision of two identical inputs.
  if (!(precision > 0)) return 0.0;
  return std::abs(y) / precision / std::sqrt(variance_K2(input, precision));
}

double NeighbourCheck::rest_without(std::size_t candidate) const noexcept {
  const double pivot = left_[at(candidate, candidate)];
  double rest = 0.0;
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (present_[i] == 0 || i == candidate) continue;
    const double cross = left_[at(i, candidate)];
    rest = std::max(rest, score(y_[i] - cross * y_[candidate] / pivot,
                                left_[at(i, i)] - cross * cross / pivot, i));
  }
  return rest;
}

NeighbourCheck::Choice NeighbourCheck::choose() const noexcept {
  const double clean = clean_share * asked_.sd_limit;
  Choice choice;
  double largest = 0.0;
  for (std::size_t i = 0; i < inputs_; ++i)
    if (present_[i] != 0) largest = std::max(largest, score(y_[i], left_[at(i, i)], i));
  if (!(largest > asked_.sd_limit)) return choice;
  // Not only inputs beyond the limit: a wrong one with a large weight in the expectation of another
  // shifts that one further than itself.
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (present_[i] == 0) continue;
    const double rest = rest_without(i);
    if (choice.found && std::max(rest, choice.rest) <= clean) choice.only = false;
    if (choice.found && rest >= choice.rest) continue;
    choice.found = true;
    choice.input = i;
    choice.rest = rest;
  }
  choice.found = score(y_[choice.input], left_[at(choice.input, choice.input)], choice.input) >
                 asked_.sd_limit;
  return choice;
}

NeighbourCheck::Answer NeighbourCheck::find(std::span<const double> change_K,
                                            const ChangeAsked& asked) noexcept {
  asked_ = asked;
  prepare(change_K);
  Answer answer;
  if (present_count_ < inputs_min) return answer;
  const double beyond = motion();
  amplified_ = beyond * beyond;
  const double clean = clean_share * asked.sd_limit;
  while (answer.count < wrong_max && present_count_ >= inputs_min) {
    const Choice choice = choose();
    if (!choice.found || !choice.only) return {};
    const std::size_t i = choice.input;
    Wrong& wrong = answer.wrong[answer.count++];
    wrong = {i, y_[i] / left_[at(i, i)], std::sqrt(variance_K2(i, left_[at(i, i)]))};
    leave_out(i);
    if (choice.rest > clean) continue;
    // The first of two was judged with the second among its neighbours.
    if (answer.count > 1) {
      const std::size_t first = answer.wrong[0].input;
      std::copy(change_K.begin(), change_K.end(), motions_.begin());
      motions_[answer.wrong[1].input] = not_a_number;
      answer.wrong[0].size_K = remainder_K(first, motions_);
    }
    return answer;
  }
  return {};
}

double NeighbourCheck::remainder_K(std::size_t input, std::span<const double> change_K) noexcept {
  prepare(change_K);
  if (present_[input] == 0 || present_count_ < 2) return not_a_number;
  return y_[input] / left_[at(input, input)];
}

}  // namespace thermocomp
