#include "estimator/lost_blocks.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// A variance below is rounding.
constexpr double variance_K2_min = 1e-12;
constexpr double temp_degC_max = 1e4;

using Matrix = Eigen::MatrixXd;

/// (C + noise^2 I)^-1, row by row.
std::vector<double> precision_of(const std::vector<std::vector<double>>& rows, double noise_K) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Matrix covariance_K2(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      covariance_K2(i, j) = rows[static_cast<std::size_t>(i)].at(static_cast<std::size_t>(j));
  // The file's matrix may be negative by what rounding does to large numbers.
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

/// 1 - exp(-age / time); 1 where it is grown at once.
double grown(nanoseconds age, double time_s) noexcept {
  if (!(time_s > 0)) return age > nanoseconds{} ? 1.0 : 0.0;
  return -std::expm1(-1e-9 * static_cast<double>(age.count()) / time_s);
}

}  // namespace

LostBlocks::LostBlocks(const ThermalModel& model, nanoseconds settle)
    : columns_(model.temperature_columns()), growth_(model.covariance_growth), settle_(settle) {
  temps_degC_.assign(columns_.size(), not_a_number);
  if (model.covariance_K2.empty()) return;
  require(model.covariance_K2.size() == model.inputs.size(), "covariance.matrix_K2",
          static_cast<double>(model.covariance_K2.size()), "must have one row an input");
  require(model.inputs.size() <= covariance_inputs_max, "covariance.matrix_K2",
          static_cast<double>(model.inputs.size()), "has more inputs than can be estimated");
  growth_.validate(model.inputs.size());
  inputs_ = model.inputs.size();
  precision_per_K2_ = precision_of(model.covariance_K2, growth_.noise_K);
  anchor_degC_.assign(inputs_, not_a_number);
  lost_.assign(inputs_, 0);
  known_.assign(inputs_, 0);
  restored_.assign(inputs_, 0);
  lost_since_.assign(inputs_, nanoseconds{});
  lost_at_.assign(inputs_, 0);
  for (auto* matrix : {&gain_, &spread_K2_, &drift_K2_, &error_K2_, &factor_})
    matrix->assign(inputs_ * inputs_, 0.0);
}

double LostBlocks::drift_factor(std::size_t input) const noexcept {
  return growth_.drift_factor.empty() ? drift_factor_default : growth_.drift_factor[input];
}

double LostBlocks::scatter_factor(std::size_t input) const noexcept {
  return growth_.scatter_factor.empty() ? 0.0 : growth_.scatter_factor[input];
}

void LostBlocks::step(nanoseconds now, std::span<const double> temps_degC,
                      std::span<const std::uint8_t> good) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == columns_.size() && good.size() == columns_.size());
  if (!started_) start_ = now;
  started_ = true;
  now_ = now;
  complete_ = std::all_of(good.begin(), good.end(), [](std::uint8_t each) { return each != 0; });
  if (!begun_ && inputs_ > 0 && (complete_ || now - start_ >= settle_)) begin(temps_degC, good);
  if (!begun_) {
    std::copy(temps_degC.begin(), temps_degC.end(), temps_degC_.begin());
    return;
  }
  bool changed = false;
  for (std::size_t i = 0; i < inputs_; ++i) changed = changed || (good[i] == 0) != (lost_[i] != 0);
  if (changed) change_pattern(now, temps_degC, good);
  for (std::size_t i = 0; i < columns_.size(); ++i)
    if (good[i] != 0 || i >= inputs_) temps_degC_[i] = temps_degC[i];
  for (std::size_t i = 0; i < inputs_; ++i)
    if (good[i] != 0) known_[i] = 1;
  if (lost_count_ == 0) return;
  complete_ = lost_count_ < inputs_;
  for (std::size_t i = inputs_; i < columns_.size(); ++i) complete_ = complete_ && good[i] != 0;
  for (std::size_t a = 0; a < lost_count_; ++a) {
    const std::size_t i = lost_at_[a];
    complete_ = complete_ && known_[i] != 0;
    if (known_[i] == 0 || lost_count_ == inputs_) continue;
    double temp_degC = anchor_degC_[i];
    for (std::size_t k = 0; k < inputs_; ++k)
      if (lost_[k] == 0) temp_degC += gain_[at(i, k)] * (temps_degC_[k] - anchor_degC_[k]);
    temps_degC_[i] = temp_degC;
  }
  grow(now);
}

/// From here on a block without a good sensor is lost, and no longer just not there yet.
void LostBlocks::begin(std::span<const double> temps_degC,
                       std::span<const std::uint8_t> good) noexcept {
  begun_ = true;
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (good[i] != 0 || restored_[i] == 0) {
      temps_degC_[i] = temps_degC[i];
      // Good once and lost again within the settling time: nobody noted the others then.
      known_[i] = good[i];
      if (good[i] == 0) lost_[i] = 1;
      // The restored values belong to one moment; they are the anchor together.
      if (restored_[i] == 0) anchor_degC_[i] = temps_degC[i];
      continue;
    }
    lost_[i] = 1;
    known_[i] = 1;
    // An unknown time ago: its drift is taken for fully grown.
    lost_since_[i] = nanoseconds::min() / 2;
    temps_degC_[i] = anchor_degC_[i];
  }
  list_lost();
  condition();
  for (std::size_t a = 0; a < lost_count_; ++a)
    for (std::size_t b = 0; b < lost_count_; ++b) {
      const std::size_t i = lost_at_[a];
      const std::size_t k = lost_at_[b];
      drift_K2_[at(i, k)] = spread_K2_[at(i, k)] * drift_factor(i) * drift_factor(k);
    }
  anchored_at_ = start_;
}

/// The input is measured again: what its estimate was off by tells of the errors of the others.
void LostBlocks::take_back(std::size_t input, double temp_degC) noexcept {
  const double variance_K2 = error_K2_[at(input, input)];
  if (known_[input] != 0 && variance_K2 > variance_K2_min) {
    const double off_K = temp_degC - temps_degC_[input];
    for (std::size_t a = 0; a < lost_count_; ++a) {
      const std::size_t i = lost_at_[a];
      if (i == input || lost_[i] == 0) continue;
      const double share = drift_K2_[at(i, input)] / variance_K2;
      temps_degC_[i] += share * off_K;
      for (std::size_t b = 0; b < lost_count_; ++b) {
        const std::size_t k = lost_at_[b];
        if (k == input || lost_[k] == 0) continue;
        const double known_K2 = share * drift_K2_[at(k, input)];
        drift_K2_[at(i, k)] -= known_K2;
        error_K2_[at(i, k)] -= known_K2;
      }
    }
  }
  lost_[input] = 0;
  temps_degC_[input] = temp_degC;
}

void LostBlocks::change_pattern(nanoseconds now, std::span<const double> temps_degC,
                                std::span<const std::uint8_t> good) noexcept {
  // What has drifted until now is carried on with.
  const double drift = grown(now - anchored_at_, growth_.drift_time_s);
  for (std::size_t a = 0; a < lost_count_; ++a)
    for (std::size_t b = 0; b < lost_count_; ++b) {
      const std::size_t i = lost_at_[a];
      const std::size_t k = lost_at_[b];
      drift_K2_[at(i, k)] += spread_K2_[at(i, k)] * drift_factor(i) * drift_factor(k) * drift;
    }
  // What was estimated a step ago is compared with what is measured now, and goes on from there.
  for (std::size_t i = 0; i < inputs_; ++i)
    if (good[i] != 0 && lost_[i] != 0) take_back(i, temps_degC[i]);
  for (std::size_t i = 0; i < inputs_; ++i) {
    if (good[i] != 0 || lost_[i] != 0) continue;
    lost_[i] = 1;
    lost_since_[i] = now;
    for (std::size_t k = 0; k < inputs_; ++k) drift_K2_[at(i, k)] = drift_K2_[at(k, i)] = 0.0;
    // The value it had last was not exact, and what it would show now would not be either.
    drift_K2_[at(i, i)] = 2.0 * growth_.noise_K * growth_.noise_K;
  }
  // A lost one: what was last measured, or estimated.
  for (std::size_t i = 0; i < inputs_; ++i)
    anchor_degC_[i] = lost_[i] != 0 ? temps_degC_[i] : temps_degC[i];
  anchored_at_ = now;
  list_lost();
  condition();
}

void LostBlocks::list_lost() noexcept {
  lost_count_ = 0;
  for (std::size_t i = 0; i < inputs_; ++i)
    if (lost_[i] != 0) lost_at_[lost_count_++] = i;
}

/// S = (Q_LL)^-1 by Cholesky, B = -S Q_LO. Loops of our own: a library's may allocate.
void LostBlocks::condition() noexcept {
  const std::size_t n = lost_count_;
  const auto place = [this](std::size_t a, std::size_t b) { return at(a, b); };
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      double sum = precision_per_K2_[at(lost_at_[a], lost_at_[b])];
      for (std::size_t c = 0; c < b; ++c) sum -= factor_[place(a, c)] * factor_[place(b, c)];
      // Q is positive definite by construction, and so is every part of it.
      factor_[place(a, b)] = a == b ? std::sqrt(sum) : sum / factor_[place(b, b)];
    }
  }
  // The factor's inverse, in place: then S is the product of its transpose and itself.
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
      spread_K2_[at(lost_at_[a], lost_at_[b])] = sum;
    }
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t k = 0; k < inputs_; ++k) {
      if (lost_[k] != 0) continue;
      double sum = 0.0;
      for (std::size_t b = 0; b < n; ++b)
        sum -= spread_K2_[at(lost_at_[a], lost_at_[b])] * precision_per_K2_[at(lost_at_[b], k)];
      gain_[at(lost_at_[a], k)] = sum;
    }
}

void LostBlocks::grow(nanoseconds now) noexcept {
  const double drift = grown(now - anchored_at_, growth_.drift_time_s);
  for (std::size_t a = 0; a < lost_count_; ++a) {
    const std::size_t i = lost_at_[a];
    const double scatter_i =
        scatter_factor(i) * std::sqrt(grown(now - lost_since_[i], growth_.scatter_time_s));
    for (std::size_t b = 0; b <= a; ++b) {
      const std::size_t k = lost_at_[b];
      const double scatter_k =
          scatter_factor(k) * std::sqrt(grown(now - lost_since_[k], growth_.scatter_time_s));
      const double growth = drift_factor(i) * drift_factor(k) * drift + scatter_i * scatter_k;
      error_K2_[at(i, k)] = error_K2_[at(k, i)] =
          drift_K2_[at(i, k)] + spread_K2_[at(i, k)] * growth;
    }
  }
}

bool LostBlocks::estimated(std::size_t column) const noexcept {
  return begun_ && column < inputs_ && lost_[column] != 0 && known_[column] != 0 &&
         lost_count_ < inputs_;
}

double LostBlocks::sd_K(std::size_t column) const noexcept {
  if (!begun_ || column >= inputs_ || lost_[column] == 0) return 0.0;
  return std::sqrt(std::max(0.0, error_K2_[at(column, column)]));
}

double LostBlocks::sd_of(std::span<const double> gain_per_K) const noexcept {
  double variance = 0.0;
  for (std::size_t a = 0; a < lost_count_; ++a)
    for (std::size_t b = 0; b < lost_count_; ++b)
      variance += gain_per_K[lost_at_[a]] * gain_per_K[lost_at_[b]] *
                  error_K2_[at(lost_at_[a], lost_at_[b])];
  return std::sqrt(std::max(0.0, variance));
}

void LostBlocks::restore(std::size_t column, double temp_degC) noexcept {
  if (column >= inputs_ || !(std::abs(temp_degC) <= temp_degC_max)) return;
  anchor_degC_[column] = temp_degC;
  restored_[column] = 1;
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
  started_ = previous.started_;
  start_ = previous.start_;
  for (std::size_t i = 0; i < column_plan_.size(); ++i)
    if (column_plan_[i] >= 0)
      temps_degC_[i] = previous.temps_degC_[static_cast<std::size_t>(column_plan_[i])];
  now_ = previous.now_;
  anchored_at_ = previous.now_;
  begun_ = inputs_ > 0 && previous.begun_;
  for (std::size_t i = 0; i < inputs_ && !begun_; ++i)
    if (input_plan_[i] >= 0) {
      const auto from = static_cast<std::size_t>(input_plan_[i]);
      restored_[i] = previous.restored_[from];
      anchor_degC_[i] = previous.anchor_degC_[from];
    }
  if (!begun_) return;
  for (std::size_t i = 0; i < inputs_; ++i) {
    // An input that is new has no past: it counts as lost until its first value.
    lost_[i] = 1;
    known_[i] = 0;
    anchor_degC_[i] = temps_degC_[i];
    if (input_plan_[i] < 0) continue;
    const auto from = static_cast<std::size_t>(input_plan_[i]);
    lost_[i] = previous.lost_[from];
    known_[i] = previous.known_[from];
    lost_since_[i] = previous.lost_since_[from];
    for (std::size_t k = 0; k < inputs_; ++k) {
      if (input_plan_[k] < 0) continue;
      const auto other = static_cast<std::size_t>(input_plan_[k]);
      if (previous.lost_[from] == 0 || previous.lost_[other] == 0) continue;
      // Other factors from now on; the error so far, scatter included, stays what it was.
      drift_K2_[at(i, k)] = error_K2_[at(i, k)] = previous.error_K2_[previous.at(from, other)];
    }
  }
  list_lost();
  condition();
}

}  // namespace thermocomp
