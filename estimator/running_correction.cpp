#include "estimator/running_correction.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

/// Two refused probings that differ by less than so many standard deviations agree.
constexpr double agreeing_sigma = 3.0;

std::string gain_key(std::size_t group) {
  return std::string("gain").append(std::to_string(group + 1));
}

/// Of "axis.key" the values of one axis, by key.
std::map<std::string, double> of_axis(const std::map<std::string, double>& values,
                                      const std::string& axis) {
  std::map<std::string, double> own;
  for (const auto& [name, value] : values)
    if (name.starts_with(axis) && name.size() > axis.size() && name[axis.size()] == '.')
      own[name.substr(axis.size() + 1)] = value;
  return own;
}

}  // namespace

void CorrectionConfig::validate() const {
  const auto in = [](double value, const char* key, double low, double high, const char* rule) {
    require(value >= low && value <= high, key, value, rule);
  };
  in(noise_um, "noise_um", 0.01, 100, "must be in [0.01, 100]");
  in(turn_um, "turn_um", 0.01, 500, "must be in [0.01, 500]");
  in(contribution_um_min, "contribution_um_min", 0.01, 500, "must be in [0.01, 500]");
  in(gain_min, "gain_min", 0.0, 1.0, "must be in [0, 1]");
  in(gain_max, "gain_max", 1.0, 10.0, "must be in [1, 10]");
  in(step_um_max, "step_um_max", 0.01, 500, "must be in [0.01, 500]");
  in(gain_sd, "gain_sd", 0.001, 10, "must be in [0.001, 10]");
  in(gain_drift_per_sqrt_h, "gain_drift_per_sqrt_h", 0, 10, "must be in [0, 10]");
  in(bias_drift_um_per_sqrt_h, "bias_drift_um_per_sqrt_h", 0, 100, "must be in [0, 100]");
  in(outlier_sigma, "outlier_sigma", 1, 100, "must be in [1, 100]");
  in(probe_sd_um, "probe_sd_um", 0.01, 500, "must be in [0.01, 500]");
}

RunningCorrection::RunningCorrection(const CorrectionConfig& config, const ThermalModel& model,
                                     std::size_t output)
    : config_(config), groups_(config.form == CorrectionForm::off ? 0 : config.groups.size()) {
  config.validate();
  require(config.groups.size() <= correction_groups_max, "correction.group",
          static_cast<double>(config.groups.size()), "must be at most 4 groups");
  require(config.form != CorrectionForm::two_phase || groups_ == 2, "correction.group",
          static_cast<double>(groups_), "must be two groups for form = \"two_phase\"");
  require(config.form != CorrectionForm::recursive || groups_ >= 1, "correction.group",
          static_cast<double>(groups_), "must be at least one group");
  std::vector<bool> named(model.inputs.size(), false);
  for (std::size_t g = 0; g < groups_; ++g) {
    inputs_.emplace_back();
    matrix_um_per_K_.emplace_back();
    for (const std::string& name : config.groups[g]) {
      const std::size_t input =
          index_of(model.inputs, name, "correction.group", "is not an input of the model");
      require(!named[input], "correction.group", static_cast<double>(g + 1),
              "names an input that is named already");
      named[input] = true;
      inputs_.back().push_back(input);
      matrix_um_per_K_.back().push_back(model.matrix_um_per_K[output][input]);
    }
  }
  for (std::size_t g = 0; g < groups_; ++g) {
    used_[g] = learned_[g] = 1.0;
    covariance_[g][g] = config.gain_sd * config.gain_sd;
  }
}

void RunningCorrection::step(nanoseconds now, std::span<const double> rise_K,
                             bool may_change) noexcept {
  now_ = now;
  contributions_um_ = contributions_um(rise_K);
  if (may_change) used_ = learned_;
}

RunningCorrection::Contributions RunningCorrection::contributions_um(
    std::span<const double> rise_K) const noexcept {
  Contributions sums_um{};
  for (std::size_t g = 0; g < groups_; ++g)
    for (std::size_t i = 0; i < inputs_[g].size(); ++i)
      sums_um[g] += matrix_um_per_K_[g][i] * rise_K[inputs_[g][i]];
  return sums_um;
}

double RunningCorrection::correction_of(const State& state,
                                        const Contributions& of_um) const noexcept {
  if (groups_ == 0) return 0.0;
  double sum_um = state[groups_];
  for (std::size_t g = 0; g < groups_; ++g) sum_um += (state[g] - 1.0) * of_um[g];
  return sum_um;
}

void RunningCorrection::measured(double displacement_um, double model_um) noexcept {
  if (groups_ == 0) return;
  if (!std::isfinite(displacement_um) || !std::isfinite(model_um)) {
    ++refused_;
    return;
  }
  if (config_.form == CorrectionForm::two_phase)
    learn_two_phases(displacement_um, model_um);
  else
    learn_recursively(displacement_um - model_um - correction_of(learned_));
}

void RunningCorrection::learn_two_phases(double displacement_um, double model_um) noexcept {
  const double p1_um = contributions_um_[0];
  const double p2_um = contributions_um_[1];
  if (phase_ == 1) {
    if (std::abs(displacement_um) > std::abs(extreme_um_)) extreme_um_ = displacement_um;
    const double back_um = (extreme_um_ - displacement_um) * (extreme_um_ < 0 ? -1.0 : 1.0);
    if (back_um > config_.turn_um) phase_ = 2;
  }
  State wanted = learned_;
  // Without the correction the model is d = rest + p1 + p2.
  const double denominator_um = phase_ == 2 ? p2_um : config_.as_printed ? model_um : p1_um;
  // A gain must not be told from next to nothing.
  if (!(std::abs(denominator_um) >= config_.contribution_um_min)) {
    ++refused_;
    return;
  }
  const double beyond_um = displacement_um - model_um;
  if (phase_ == 2)
    wanted[1] = 1.0 + (beyond_um - (learned_[0] - 1.0) * p1_um) / p2_um;
  else
    wanted[0] = config_.as_printed ? displacement_um / model_um : 1.0 + beyond_um / p1_um;
  move_to(wanted);
}

RunningCorrection::State RunningCorrection::slopes() const noexcept {
  State slopes{};
  for (std::size_t g = 0; g < groups_; ++g) slopes[g] = contributions_um_[g];
  slopes[groups_] = config_.bias_drift_um_per_sqrt_h > 0 ? 1.0 : 0.0;
  return slopes;
}

double RunningCorrection::hours_since_probing() const noexcept {
  return std::max(0.0, std::chrono::duration<double, std::ratio<3600>>(now_ - probed_at_).count());
}

double RunningCorrection::sd_um() const noexcept {
  if (config_.form != CorrectionForm::recursive) return 0.0;
  const State h = slopes();
  const double hours = taken_ == 0 ? 0.0 : hours_since_probing();
  const double gain_drift = config_.gain_drift_per_sqrt_h * config_.gain_drift_per_sqrt_h * hours;
  const double bias_drift =
      config_.bias_drift_um_per_sqrt_h * config_.bias_drift_um_per_sqrt_h * hours;
  double variance = 0.0;
  for (std::size_t i = 0; i <= groups_; ++i) {
    for (std::size_t j = 0; j <= groups_; ++j) variance += h[i] * covariance_[i][j] * h[j];
    variance += h[i] * h[i] * (i < groups_ ? gain_drift : bias_drift);
  }
  return std::sqrt(std::max(0.0, variance));
}

void RunningCorrection::learn_recursively(double error_um) noexcept {
  if (taken_ > 0) {
    const double hours = hours_since_probing();
    for (std::size_t i = 0; i <= groups_; ++i) {
      const double drift =
          i < groups_ ? config_.gain_drift_per_sqrt_h : config_.bias_drift_um_per_sqrt_h;
      covariance_[i][i] += drift * drift * hours;
    }
  } else {
    covariance_[groups_][groups_] =
        config_.bias_drift_um_per_sqrt_h * config_.bias_drift_um_per_sqrt_h;
  }
  probed_at_ = now_;
  const State h = slopes();
  State ph{};
  double variance = config_.noise_um * config_.noise_um;
  for (std::size_t i = 0; i <= groups_; ++i)
    for (std::size_t j = 0; j <= groups_; ++j) ph[i] += covariance_[i][j] * h[j];
  for (std::size_t i = 0; i <= groups_; ++i) variance += h[i] * ph[i];
  const bool far = !(std::abs(error_um) <= config_.outlier_sigma * std::sqrt(variance));
  const bool agrees = doubted_ && std::abs(error_um - refused_error_um_) <=
                                      agreeing_sigma * std::sqrt(2.0) * config_.noise_um;
  if (far && !agrees) {
    doubted_ = true;
    refused_error_um_ = error_um;
    ++refused_;
    return;
  }
  doubted_ = false;
  State wanted = learned_;
  for (std::size_t i = 0; i <= groups_; ++i) wanted[i] += ph[i] / variance * error_um;
  for (std::size_t i = 0; i <= groups_; ++i)
    for (std::size_t j = 0; j <= groups_; ++j) covariance_[i][j] -= ph[i] * ph[j] / variance;
  move_to(wanted);
}

void RunningCorrection::move_to(State wanted) noexcept {
  for (std::size_t g = 0; g < groups_; ++g)
    wanted[g] = std::clamp(wanted[g], config_.gain_min, config_.gain_max);
  const double change_um = correction_of(wanted) - correction_of(learned_);
  const double share =
      std::abs(change_um) > config_.step_um_max ? config_.step_um_max / std::abs(change_um) : 1.0;
  for (std::size_t i = 0; i <= groups_; ++i) learned_[i] += share * (wanted[i] - learned_[i]);
  for (std::size_t g = 0; g < groups_; ++g)  // a share of the way can round beyond its end
    learned_[g] = std::clamp(learned_[g], config_.gain_min, config_.gain_max);
  ++taken_;
}

void RunningCorrection::restart() noexcept {
  learned_[groups_] = used_[groups_] = 0.0;
  phase_ = 1;
  extreme_um_ = 0.0;
  doubted_ = false;
}

CorrectionReport RunningCorrection::report() const noexcept {
  CorrectionReport report;
  for (std::size_t g = 0; g < groups_; ++g) {
    report.gain[g] = learned_[g];
    report.gain_used[g] = used_[g];
    report.gain_sd[g] = std::sqrt(std::max(0.0, covariance_[g][g]));
  }
  report.bias_um = groups_ == 0 ? 0.0 : learned_[groups_];
  report.bias_used_um = groups_ == 0 ? 0.0 : used_[groups_];
  report.sd_um = sd_um();
  report.probing_wanted = report.sd_um > config_.probe_sd_um;
  report.phase = phase_;
  report.taken = taken_;
  report.refused = refused_;
  return report;
}

std::map<std::string, double> RunningCorrection::persistent(const CorrectionReport& report) {
  std::map<std::string, double> values;
  for (std::size_t g = 0; g < correction_groups_max; ++g) {
    if (report.gain[g] == 0.0 && report.gain_sd[g] == 0.0) continue;  // there is no such group
    values[gain_key(g)] = report.gain[g];
    values[gain_key(g).append("_sd")] = report.gain_sd[g];
    if (report.gain_used[g] != report.gain[g])
      values[gain_key(g).append("_used")] = report.gain_used[g];
  }
  if (values.empty()) return values;
  values["bias_um"] = report.bias_um;
  if (report.bias_used_um != report.bias_um) values["bias_used_um"] = report.bias_used_um;
  values["phase"] = report.phase;
  return values;
}

void RunningCorrection::restore(const std::map<std::string, double>& of_all_axes,
                                const std::string& axis) {
  const std::map<std::string, double> values = of_axis(of_all_axes, axis);
  const auto find = [&](const std::string& name, double otherwise) {
    const auto found = values.find(name);
    return found == values.end() ? otherwise : found->second;
  };
  for (std::size_t g = 0; g < groups_; ++g) {
    const auto is_gain = [&](double value) {
      return value >= config_.gain_min && value <= config_.gain_max;
    };
    const double gain = find(gain_key(g), 1.0);
    if (!is_gain(gain)) continue;
    learned_[g] = used_[g] = gain;
    // What was learned mid-cut waits for its end in the next life too.
    const double gain_used = find(gain_key(g).append("_used"), gain);
    if (is_gain(gain_used)) used_[g] = gain_used;
    // The past of the machine is not known any more: at least as sure as at a first start, never
    // surer than before it.
    const double sd = find(gain_key(g).append("_sd"), config_.gain_sd);
    if (sd >= 0 && sd <= config_.gain_sd) covariance_[g][g] = sd * sd;
  }
  // Several probings together may have taught more than one step.
  const auto is_bias = [](double value) { return std::abs(value) <= offset_um_max_of_any_axis; };
  const double bias_um = find("bias_um", 0.0);
  if (groups_ > 0 && is_bias(bias_um)) {
    const double bias_used_um = find("bias_used_um", bias_um);
    learned_[groups_] = bias_um;
    used_[groups_] = is_bias(bias_used_um) ? bias_used_um : bias_um;
  }
  if (find("phase", 1.0) == 2.0) phase_ = 2;
}

void RunningCorrection::adopt(const RunningCorrection& previous) noexcept {
  if (config_.form != previous.config_.form || config_.groups != previous.config_.groups) return;
  used_ = previous.used_;
  learned_ = previous.learned_;
  covariance_ = previous.covariance_;
  contributions_um_ = previous.contributions_um_;
  now_ = previous.now_;
  probed_at_ = previous.probed_at_;
  refused_error_um_ = previous.refused_error_um_;
  doubted_ = previous.doubted_;
  phase_ = previous.phase_;
  extreme_um_ = previous.extreme_um_;
  taken_ = previous.taken_;
  refused_ = previous.refused_;
}

}  // namespace thermocomp
