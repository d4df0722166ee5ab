#include "estimator/sensing/lost_blocks.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/sensing/neighbour_check.hpp"

namespace thermocomp {
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

/// From here on a block without a good sensor is lost, not starting up.
void LostBlocks::begin(std::span<const double> temps_degC,
                       std::span<const std::uint8_t> good) noexcept {
  state_.begun = true;
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (good[i] != 0 || state_.restored[i] == 0) {
      state_.temps_degC[i] = temps_degC[i];
      // Good once and lost again within the settling time: the others were not recorded then.
      state_.known[i] = good[i];
      if (good[i] == 0) state_.lost[i] = 1;
      // Restored values are of one moment; together they are the anchor.
      if (state_.restored[i] == 0) state_.anchor_degC[i] = temps_degC[i];
      continue;
    }
    state_.lost[i] = 1;
    state_.known[i] = 1;
    // Lost an unknown time ago: its drift counts as fully grown.
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
  // Carries the drift so far over.
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
