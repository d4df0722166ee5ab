#include "estimator/sensing/neighbours.hpp"

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

/// Smallest standard deviation of a thermocouple over hours, even if the record's matrix gives
/// less.
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

/// Removes the input from the precision matrix.
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
  // All inputs, not only those beyond the limit: a wrong one with a large weight in another's
  // expectation shifts the other further than itself.
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
    // The first of two was judged while the second still counted as a neighbour.
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

namespace {

/// A smaller variance is rounding.
constexpr double variance_K2_min = 1e-12;
constexpr double temp_degC_max = 1e4;

double grown(nanoseconds age, double time_s) noexcept {
  return thermocomp::grown(to_seconds(age), time_s);
}

}  // namespace

LostBlocks::LostBlocks(const ThermalModel& model, nanoseconds settle)
    : columns_(model.temperature_columns()), growth_(model.covariance_growth), settle_(settle) {
  state_.temps_degC.assign(columns_.size(), not_a_number);
  if (model.covariance_K2.empty()) return;
  precision_per_K2_ = precision_per_K2(model);
  inputs_ = model.inputs.size();
  state_.anchor_degC.assign(inputs_, not_a_number);
  state_.lost.assign(inputs_, 0);
  state_.known.assign(inputs_, 0);
  state_.restored.assign(inputs_, 0);
  state_.lost_since.assign(inputs_, nanoseconds{});
  state_.lost_at.assign(inputs_, 0);
  given_K2_.assign(inputs_, 0.0);
  for (auto* matrix :
       {&state_.gain, &state_.spread_K2, &state_.drift_K2, &state_.error_K2, &factor_})
    matrix->assign(inputs_ * inputs_, 0.0);
}

void LostBlocks::step(nanoseconds now, std::span<const double> temps_degC,
                      std::span<const std::uint8_t> good) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == columns_.size() && good.size() == columns_.size());
  if (!state_.started) state_.start = now;
  state_.started = true;
  state_.now = now;
  state_.complete =
      std::all_of(good.begin(), good.end(), [](std::uint8_t each) { return each != 0; });
  if (!state_.begun && inputs_ > 0 && (state_.complete || now - state_.start >= settle_))
    begin(temps_degC, good);
  if (!state_.begun) {
    std::copy(temps_degC.begin(), temps_degC.end(), state_.temps_degC.begin());
    return;
  }
  bool changed = false;
  for (std::size_t i = 0; i < inputs_; ++i)
    changed = changed || (good[i] == 0) != (state_.lost[i] != 0);
  if (changed) change_pattern(now, temps_degC, good);
  // Valid for one step, so not archived: a block may continue with another sensor.
  std::fill(given_K2_.begin(), given_K2_.end(), 0.0);
  for (std::size_t i = 0; i < columns_.size(); ++i)
    if (good[i] != 0 || i >= inputs_) state_.temps_degC[i] = temps_degC[i];
  for (std::size_t i = 0; i < inputs_; ++i)
    if (good[i] != 0) state_.known[i] = 1;
  if (state_.lost_count == 0) return;
  state_.complete = state_.lost_count < inputs_;
  for (std::size_t i = inputs_; i < columns_.size(); ++i)
    state_.complete = state_.complete && good[i] != 0;
  for (std::size_t a = 0; a < state_.lost_count; ++a) {
    const std::size_t i = state_.lost_at[a];
    state_.complete = state_.complete && state_.known[i] != 0;
    if (state_.known[i] == 0 || state_.lost_count == inputs_) continue;
    double temp_degC = state_.anchor_degC[i];
    for (std::size_t k = 0; k < inputs_; ++k)
      if (state_.lost[k] == 0)
        temp_degC += state_.gain[at(i, k)] * (state_.temps_degC[k] - state_.anchor_degC[k]);
    state_.temps_degC[i] = temp_degC;
  }
  grow(now);
}

/// From now on a block without a good sensor is lost, not starting up.
void LostBlocks::begin(std::span<const double> temps_degC,
                       std::span<const std::uint8_t> good) noexcept {
  state_.begun = true;
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (good[i] != 0 || state_.restored[i] == 0) {
      state_.temps_degC[i] = temps_degC[i];
      // Good once and lost again within the settling time, when the others were not recorded.
      state_.known[i] = good[i];
      if (good[i] == 0) state_.lost[i] = 1;
      // Restored values share one moment; together they are the anchor.
      if (state_.restored[i] == 0) state_.anchor_degC[i] = temps_degC[i];
      continue;
    }
    state_.lost[i] = 1;
    state_.known[i] = 1;
    // The time of its loss is unknown, so its drift counts as fully grown.
    state_.lost_since[i] = nanoseconds::min() / 2;
    state_.temps_degC[i] = state_.anchor_degC[i];
  }
  list_lost();
  condition();
  for (std::size_t a = 0; a < state_.lost_count; ++a)
    for (std::size_t b = 0; b < state_.lost_count; ++b) {
      const std::size_t i = state_.lost_at[a];
      const std::size_t k = state_.lost_at[b];
      state_.drift_K2[at(i, k)] =
          state_.spread_K2[at(i, k)] * drift_factor(growth_, i) * drift_factor(growth_, k);
    }
  state_.anchored_at = state_.start;
}

/// The input is measured again: the error of its estimate corrects the others.
void LostBlocks::take_back(std::size_t input, double temp_degC) noexcept {
  const double variance_K2 = state_.error_K2[at(input, input)];
  if (state_.known[input] != 0 && variance_K2 > variance_K2_min) {
    const double off_K = temp_degC - state_.temps_degC[input];
    for (std::size_t a = 0; a < state_.lost_count; ++a) {
      const std::size_t i = state_.lost_at[a];
      if (i == input || state_.lost[i] == 0) continue;
      const double share = state_.drift_K2[at(i, input)] / variance_K2;
      state_.temps_degC[i] += share * off_K;
      for (std::size_t b = 0; b < state_.lost_count; ++b) {
        const std::size_t k = state_.lost_at[b];
        if (k == input || state_.lost[k] == 0) continue;
        const double known_K2 = share * state_.drift_K2[at(k, input)];
        state_.drift_K2[at(i, k)] -= known_K2;
        state_.error_K2[at(i, k)] -= known_K2;
      }
    }
  }
  state_.lost[input] = 0;
  state_.temps_degC[input] = temp_degC;
}

void LostBlocks::change_pattern(nanoseconds now, std::span<const double> temps_degC,
                                std::span<const std::uint8_t> good) noexcept {
  // Adds the drift so far.
  const double drift = grown(now - state_.anchored_at, growth_.drift_time_s);
  for (std::size_t a = 0; a < state_.lost_count; ++a)
    for (std::size_t b = 0; b < state_.lost_count; ++b) {
      const std::size_t i = state_.lost_at[a];
      const std::size_t k = state_.lost_at[b];
      state_.drift_K2[at(i, k)] +=
          state_.spread_K2[at(i, k)] * drift_factor(growth_, i) * drift_factor(growth_, k) * drift;
    }
  // Compares the estimate of the last step with the present value and continues from there.
  for (std::size_t i = 0; i < inputs_; ++i)
    if (good[i] != 0 && state_.lost[i] != 0) take_back(i, temps_degC[i]);
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (good[i] != 0 || state_.lost[i] != 0) continue;
    state_.lost[i] = 1;
    state_.lost_since[i] = now;
    for (std::size_t k = 0; k < inputs_; ++k)
      state_.drift_K2[at(i, k)] = state_.drift_K2[at(k, i)] = 0.0;
    // Noise of the last value and of the present one.
    state_.drift_K2[at(i, i)] = 2.0 * growth_.noise_K * growth_.noise_K + given_K2_[i];
  }
  // For a lost input, the last measured or estimated value.
  for (std::size_t i = 0; i < inputs_; ++i)
    state_.anchor_degC[i] = state_.lost[i] != 0 ? state_.temps_degC[i] : temps_degC[i];
  state_.anchored_at = now;
  list_lost();
  condition();
}

void LostBlocks::continue_from(std::size_t input, double temp_degC, double sd_K) noexcept {
  if (!state_.begun || input >= inputs_ || state_.lost[input] != 0) return;
  state_.temps_degC[input] = temp_degC;
  given_K2_[input] = sd_K * sd_K;
}

void LostBlocks::list_lost() noexcept {
  state_.lost_count = 0;
  for (std::size_t i = 0; i < inputs_; ++i)
    if (state_.lost[i] != 0) state_.lost_at[state_.lost_count++] = i;
}

/// S = (Q_LL)^-1 by Cholesky, B = -S Q_LO. Own loops, since a library may allocate.
void LostBlocks::condition() noexcept {
  const std::size_t n = state_.lost_count;
  const auto place = [this](std::size_t a, std::size_t b) { return at(a, b); };
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      double sum = precision_per_K2_[at(state_.lost_at[a], state_.lost_at[b])];
      for (std::size_t c = 0; c < b; ++c) sum -= factor_[place(a, c)] * factor_[place(b, c)];
      // Q and each of its principal submatrices are positive definite.
      factor_[place(a, b)] = a == b ? std::sqrt(sum) : sum / factor_[place(b, b)];
    }
  }
  // Inverts the factor in place; S is the product of its transpose and itself.
  for (std::size_t b = 0; b < n; ++b) {
    factor_[place(b, b)] = 1.0 / factor_[place(b, b)];
    for (std::size_t a = b + 1; a < n; ++a) {
      double sum = 0.0;
      for (std::size_t c = b; c < a; ++c) sum -= factor_[place(a, c)] * factor_[place(c, b)];
      factor_[place(a, b)] = sum / factor_[place(a, a)];
    }
  }
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b < n; ++b) {
      double sum = 0.0;
      for (std::size_t c = std::max(a, b); c < n; ++c)
        sum += factor_[place(c, a)] * factor_[place(c, b)];
      state_.spread_K2[at(state_.lost_at[a], state_.lost_at[b])] = sum;
    }
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t k = 0; k < inputs_; ++k) {
      if (state_.lost[k] != 0) continue;
      double sum = 0.0;
      for (std::size_t b = 0; b < n; ++b)
        sum -= state_.spread_K2[at(state_.lost_at[a], state_.lost_at[b])] *
               precision_per_K2_[at(state_.lost_at[b], k)];
      state_.gain[at(state_.lost_at[a], k)] = sum;
    }
}

void LostBlocks::grow(nanoseconds now) noexcept {
  const double drift = grown(now - state_.anchored_at, growth_.drift_time_s);
  for (std::size_t a = 0; a < state_.lost_count; ++a) {
    const std::size_t i = state_.lost_at[a];
    const double scatter_i = scatter_factor(growth_, i) *
                             std::sqrt(grown(now - state_.lost_since[i], growth_.scatter_time_s));
    for (std::size_t b = 0; b <= a; ++b) {
      const std::size_t k = state_.lost_at[b];
      const double scatter_k = scatter_factor(growth_, k) *
                               std::sqrt(grown(now - state_.lost_since[k], growth_.scatter_time_s));
      const double growth =
          drift_factor(growth_, i) * drift_factor(growth_, k) * drift + scatter_i * scatter_k;
      state_.error_K2[at(i, k)] = state_.error_K2[at(k, i)] =
          state_.drift_K2[at(i, k)] + state_.spread_K2[at(i, k)] * growth;
    }
  }
}

bool LostBlocks::estimated(std::size_t column) const noexcept {
  return state_.begun && column < inputs_ && state_.lost[column] != 0 &&
         state_.known[column] != 0 && state_.lost_count < inputs_;
}

double LostBlocks::sd_K(std::size_t column) const noexcept {
  if (!state_.begun || column >= inputs_ || state_.lost[column] == 0) return 0.0;
  return std::sqrt(std::max(0.0, state_.error_K2[at(column, column)]));
}

double LostBlocks::sd_of(std::span<const double> gain_per_K) const noexcept {
  double variance = 0.0;
  for (std::size_t a = 0; a < state_.lost_count; ++a)
    for (std::size_t b = 0; b < state_.lost_count; ++b)
      variance += gain_per_K[state_.lost_at[a]] * gain_per_K[state_.lost_at[b]] *
                  state_.error_K2[at(state_.lost_at[a], state_.lost_at[b])];
  return std::sqrt(std::max(0.0, variance));
}

void LostBlocks::restore(std::size_t column, double temp_degC) noexcept {
  if (column >= inputs_ || !(std::abs(temp_degC) <= temp_degC_max)) return;
  state_.anchor_degC[column] = temp_degC;
  state_.restored[column] = 1;
}

void LostBlocks::plan_adoption(const LostBlocks& previous) {
  const auto plan = [](const std::vector<std::string>& ours, const std::vector<std::string>& theirs,
                       std::size_t count, std::size_t from) {
    std::vector<int> indices;
    for (std::size_t i = 0; i < count; ++i) {
      const auto end = theirs.begin() + static_cast<std::ptrdiff_t>(from);
      const auto found = std::find(theirs.begin(), end, ours[i]);
      indices.push_back(found == end ? -1 : static_cast<int>(found - theirs.begin()));
    }
    return indices;
  };
  column_plan_ = plan(columns_, previous.columns_, columns_.size(), previous.columns_.size());
  input_plan_ = plan(columns_, previous.columns_, inputs_, previous.inputs_);
}

void LostBlocks::adopt(const LostBlocks& previous) noexcept {
  state_.started = previous.state_.started;
  state_.start = previous.state_.start;
  for (std::size_t i = 0; i < column_plan_.size(); ++i)
    if (column_plan_[i] >= 0)
      state_.temps_degC[i] = previous.state_.temps_degC[static_cast<std::size_t>(column_plan_[i])];
  state_.now = previous.state_.now;
  state_.anchored_at = previous.state_.now;
  state_.begun = inputs_ > 0 && previous.state_.begun;
  for (std::size_t i = 0; i < inputs_ && !state_.begun; ++i)
    if (input_plan_[i] >= 0) {
      const auto from = static_cast<std::size_t>(input_plan_[i]);
      state_.restored[i] = previous.state_.restored[from];
      state_.anchor_degC[i] = previous.state_.anchor_degC[from];
    }
  if (!state_.begun) return;
  for (std::size_t i = 0; i < inputs_; ++i) {
    // A new input has no past: lost until its first value.
    state_.lost[i] = 1;
    state_.known[i] = 0;
    state_.anchor_degC[i] = state_.temps_degC[i];
    if (input_plan_[i] < 0) continue;
    const auto from = static_cast<std::size_t>(input_plan_[i]);
    state_.lost[i] = previous.state_.lost[from];
    state_.known[i] = previous.state_.known[from];
    state_.lost_since[i] = previous.state_.lost_since[from];
    for (std::size_t k = 0; k < inputs_; ++k) {
      if (input_plan_[k] < 0) continue;
      const auto other = static_cast<std::size_t>(input_plan_[k]);
      if (previous.state_.lost[from] == 0 || previous.state_.lost[other] == 0) continue;
      // The factors may have changed; the error so far, scatter included, is kept.
      state_.drift_K2[at(i, k)] = state_.error_K2[at(i, k)] =
          previous.state_.error_K2[previous.at(from, other)];
    }
  }
  list_lost();
  condition();
}

}  // namespace thermocomp
