#include "estimator/learning/probings.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {

Probings::Probings(const EstimatorConfig& config, const ThermalModel& model,
                   const std::vector<std::size_t>& axis_output)
    : axis_names_(entry_names(config.axes)),
      is_on_(config.correction.form != CorrectionForm::off),
      meaning_(config.correction.measured),
      errors_(config.axes.size()),
      last_(config.axes.size()),
      measured_um_(config.axes.size(), not_a_number),
      operator_um_(config.axes.size()),
      past_(is_on_ ? past_moments * config.axes.size() : 0),
      rise_K_(model.temperature_columns().size(), 0.0) {
  for (const std::size_t output : axis_output)
    corrections_.emplace_back(config.correction, model, output);
}

void Probings::step(nanoseconds now, std::span<const double> temps_degC,
                    std::span<const double> reference_degC, bool may_change) noexcept {
  for (std::size_t i = 0; i < rise_K_.size(); ++i) rise_K_[i] = temps_degC[i] - reference_degC[i];
  for (RunningCorrection& correction : corrections_) correction.step(now, rise_K_, may_change);
  if (!may_change) return;
  for (OperatorOffset& each : operator_um_) each.absorbed_um = each.learned_um;
}

void Probings::learn(std::size_t axis, const MeasuredValue& measured,
                     const PastMoment& moment) noexcept {
  OperatorOffset& entered = operator_um_[axis];
  const double total_um = without_offset_um(measured.value_um, moment);
  errors_[axis].take(total_um - moment.model_um);
  last_[axis] = {total_um, moment.model_um};
  const double before_um = corrections_[axis].learned_um();
  corrections_[axis].measured({total_um, moment.model_um, measured.sd_um, moment.contributions_um});
  if (measured.source != MeasuredSource::wear || !is_on_ || !std::isfinite(measured.value_um))
    return;
  entered.entered_um += measured.value_um;
  entered.learned_um += corrections_[axis].learned_um() - before_um;
}

PastMoment Probings::present(std::size_t axis, double compensated_um,
                             double model_um) const noexcept {
  return {{},
          compensated_um,
          model_um,
          operator_um_[axis].entered_um,
          corrections_[axis].contributions_um()};
}

const PastMoment* Probings::past(std::size_t axis, nanoseconds at) const noexcept {
  const PastMoment* nearest = nullptr;
  for (std::size_t i = 0; i < (is_on_ ? past_moments : 0); ++i) {
    const PastMoment& each = past_[axis * past_moments + i];
    if (!std::isfinite(each.model_um)) continue;
    if (nearest == nullptr || std::chrono::abs(each.at - at) < std::chrono::abs(nearest->at - at))
      nearest = &each;
  }
  const bool is_there = nearest != nullptr && std::chrono::abs(nearest->at - at) <= 2 * past_pitch;
  return is_there ? nearest : nullptr;
}

void Probings::remember(std::size_t axis, const PastMoment& moment) noexcept {
  if (moment.at != remembered_at_) {
    next_past_ = (next_past_ + 1) % past_moments;
    remembered_ = std::min(remembered_ + 1, past_moments);
  }
  remembered_at_ = moment.at;
  past_[axis * past_moments + next_past_] = moment;
}

void Probings::restart() noexcept {
  for (RunningCorrection& correction : corrections_) correction.restart();
  std::fill(operator_um_.begin(), operator_um_.end(), OperatorOffset{});
  std::fill(last_.begin(), last_.end(), LastProbing{});
  std::fill(past_.begin(), past_.end(), PastMoment{});
  remembered_ = 0;
}

void Probings::restore(const std::map<std::string, double>& corrections) {
  for (std::size_t i = 0; i < corrections_.size(); ++i) {
    corrections_[i].restore(corrections, axis_names_[i]);
    const auto bounded = [&](const char* key) {
      double value_um = 0.0;
      take_if_finite(corrections, axis_names_[i] + key, value_um);
      return std::abs(value_um) <= offset_um_max_of_any_axis ? value_um : 0.0;
    };
    operator_um_[i].entered_um = bounded(".entered_um");
    operator_um_[i].absorbed_um = operator_um_[i].learned_um = bounded(".absorbed_um");
    take_if_finite(corrections, axis_names_[i] + ".probed_um", last_[i].without_offset_um);
    take_if_finite(corrections, axis_names_[i] + ".probed_model_um", last_[i].model_um);
  }
}

void Probings::adopt(const Probings& previous, const std::vector<int>& axes) noexcept {
  take_by_plan(axes, previous.measured_um_, measured_um_);
  take_by_plan(axes, previous.last_, last_);
  take_by_plan(axes, previous.operator_um_, operator_um_);
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i] >= 0)
      corrections_[i].adopt(previous.corrections_[static_cast<std::size_t>(axes[i])]);
}

void Probings::adopt_errors(const Probings& previous, const std::vector<int>& axes) noexcept {
  take_by_plan(axes, previous.errors_, errors_);
}

void Probings::visit_learned(StateArchive& archive) {
  for (RunningCorrection& correction : corrections_) archive(correction);
  for (ProbedError& error : errors_) archive(error);
}

void Probings::visit_operators(StateArchive& archive) {
  for (OperatorOffset& each : operator_um_)
    archive(each.entered_um, each.absorbed_um, each.learned_um);
  for (PastMoment& each : past_)
    archive(each.at, each.compensated_um, each.model_um, each.entered_um, each.contributions_um);
  archive(next_past_, remembered_, remembered_at_);
}

namespace {

/// Two refused probings within this many standard deviations of each other agree.
constexpr double agreeing_sigma = 3.0;
/// Period of the look-up; gains change within minutes.
constexpr std::chrono::seconds look_up_period{1};

bool has_course(const ThermalModel& model, std::size_t output) {
  return model.course && model.course->outputs.contains(model.outputs[output]);
}

std::string gain_key(std::size_t group) {
  return std::string("gain").append(std::to_string(group + 1));
}

/// Values of one axis from those named "axis.key", by key.
std::map<std::string, double> of_axis(const std::map<std::string, double>& values,
                                      const std::string& axis) {
  std::map<std::string, double> own;
  for (const auto& [name, value] : values)
    if (name.starts_with(axis) && name.size() > axis.size() && name[axis.size()] == '.')
      own[name.substr(axis.size() + 1)] = value;
  return own;
}

}  // namespace

RunningCorrection::RunningCorrection(const CorrectionConfig& config, const ThermalModel& model,
                                     std::size_t output)
    : config_(config),
      groups_(config.form == CorrectionForm::off ? 0 : config.groups.size()),
      record_(config.turn_um) {
  config.validate();
  require(config.groups.size() <= correction_groups_max, "correction.group",
          static_cast<double>(config.groups.size()), "must be at most 4 groups");
  require(config.form != CorrectionForm::two_phase || groups_ == 2, "correction.group",
          static_cast<double>(groups_), "must be two groups for form = \"two_phase\"");
  require(config.form == CorrectionForm::off || groups_ >= 1, "correction.group",
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
    state_.used[g] = state_.learned[g] = 1.0;
    state_.covariance[g][g] = config.gain_sd * config.gain_sd;
  }
  if (groups_ == 0 || !has_course(model, output)) return;
  require(model.course->groups == config.groups, "correction.group", static_cast<double>(groups_),
          "must be the groups of the model's [course]");
  course_.emplace(*model.course, model, output, config.gain_sd);
  record_.recorded.gain.fill(1.0);
  record_.recorded.sd.fill(config.gain_sd);
}

void RunningCorrection::step(nanoseconds now, std::span<const double> rise_K,
                             bool may_change) noexcept {
  state_.now = now;
  state_.contributions_um = contributions_um(rise_K);
  if (course_) look_up(rise_K);
  if (may_change) state_.used = joint_gains();
}

void RunningCorrection::look_up(std::span<const double> rise_K) noexcept {
  double sum_um = 0.0;
  for (std::size_t g = 0; g < groups_; ++g) sum_um += state_.contributions_um[g];
  record_.phase.step(state_.now, state_.contributions_um[0], sum_um);
  if (record_.looked && state_.now - record_.looked_at < look_up_period) return;
  record_.recorded = course_->at(record_.phase.phase(), record_.phase.since_s(), rise_K);
  record_.looked = true;
  record_.looked_at = state_.now;
}

double RunningCorrection::learned_variance(std::size_t group) const noexcept {
  if (state_.taken == 0) return std::numeric_limits<double>::infinity();
  const double drift = config_.gain_drift_per_sqrt_h * config_.gain_drift_per_sqrt_h;
  const double probed = config_.form == CorrectionForm::recursive
                            ? state_.covariance[group][group]
                            : record_.probed_sd[group] * record_.probed_sd[group];
  return probed + drift * hours_since_probing();
}

double RunningCorrection::joint_variance(std::size_t group) const noexcept {
  return std::min(record_.recorded.sd[group] * record_.recorded.sd[group], learned_variance(group));
}

RunningCorrection::Gains RunningCorrection::joint_gains() const noexcept {
  Gains gains = state_.learned;
  if (!course_) return gains;
  for (std::size_t g = 0; g < groups_; ++g) {
    const double recorded = record_.recorded.sd[g] * record_.recorded.sd[g];
    const double learned = learned_variance(g);
    double share = 0.0;  // of the learned gain
    if (std::isfinite(learned))
      share = recorded + learned > 0 ? recorded / (recorded + learned) : 1;
    gains[g] = std::clamp(record_.recorded.gain[g] + share * (gains[g] - record_.recorded.gain[g]),
                          config_.gain_min, config_.gain_max);
  }
  return gains;
}

void RunningCorrection::go_on_from_joint() noexcept {
  Gains scale{};
  scale[groups_] = 1.0;
  for (std::size_t g = 0; g < groups_; ++g) {
    const double variance = state_.covariance[g][g];
    scale[g] = variance > 0 ? std::sqrt(joint_variance(g) / variance) : 1.0;
    record_.probed_sd[g] = std::sqrt(joint_variance(g));
  }
  state_.learned = joint_gains();
  state_.probed_at = state_.now;  // the variances include the time since the last one
  for (std::size_t i = 0; i <= groups_; ++i)
    for (std::size_t j = 0; j <= groups_; ++j) state_.covariance[i][j] *= scale[i] * scale[j];
}

RunningCorrection::Contributions RunningCorrection::contributions_um(
    std::span<const double> rise_K) const noexcept {
  Contributions sums_um{};
  for (std::size_t g = 0; g < groups_; ++g)
    for (std::size_t i = 0; i < inputs_[g].size(); ++i)
      sums_um[g] += matrix_um_per_K_[g][i] * rise_K[inputs_[g][i]];
  return sums_um;
}

double RunningCorrection::correction_of(const Gains& state,
                                        const Contributions& of_um) const noexcept {
  if (groups_ == 0) return 0.0;
  double sum_um = state[groups_];
  for (std::size_t g = 0; g < groups_; ++g) sum_um += (state[g] - 1.0) * of_um[g];
  return sum_um;
}

void RunningCorrection::measured(const Measured& measured) noexcept {
  if (groups_ == 0) return;
  const double displacement_um = measured.displacement_um;
  const double model_um = measured.model_um;
  if (!std::isfinite(displacement_um) || !std::isfinite(model_um)) {
    refuse();
    return;
  }
  const double sd_um = measured.sd_um > 0 ? measured.sd_um : config_.noise_um;
  const Contributions now_um = state_.contributions_um;
  if (measured.contributions_um) state_.contributions_um = *measured.contributions_um;
  if (course_) go_on_from_joint();
  switch (config_.form) {
    case CorrectionForm::off:
      break;
    case CorrectionForm::two_phase:
      learn_two_phases(displacement_um, model_um, sd_um);
      break;
    case CorrectionForm::recursive:
      learn_recursively(displacement_um - model_um - correction_of(state_.learned), sd_um);
      break;
    case CorrectionForm::constant: {
      Gains wanted = state_.learned;
      wanted[groups_] = displacement_um - model_um;
      move_to(wanted);
      break;
    }
  }
  state_.contributions_um = now_um;
}

void RunningCorrection::learn_two_phases(double displacement_um, double model_um,
                                         double sd_um) noexcept {
  const double p1_um = state_.contributions_um[0];
  const double p2_um = state_.contributions_um[1];
  if (state_.phase == 1) {
    if (std::abs(displacement_um) > std::abs(state_.extreme_um))
      state_.extreme_um = displacement_um;
    const double back_um =
        (state_.extreme_um - displacement_um) * (state_.extreme_um < 0 ? -1.0 : 1.0);
    if (back_um > config_.turn_um) state_.phase = 2;
  }
  Gains wanted = state_.learned;
  // Without the correction the model is d = rest + p1 + p2.
  const bool by_model = state_.phase == 1 && config_.first_gain == FirstGain::eq_34;
  const double denominator_um = state_.phase == 2 ? p2_um : by_model ? model_um : p1_um;
  // A small contribution does not determine its gain.
  if (!(std::abs(denominator_um) >= config_.contribution_um_min)) {
    ++state_.refused;
    return;
  }
  const double beyond_um = displacement_um - model_um;
  if (state_.phase == 2)
    wanted[1] = 1.0 + (beyond_um - (state_.learned[0] - 1.0) * p1_um) / p2_um;
  else
    wanted[0] = config_.first_gain == FirstGain::consistent ? 1.0 + beyond_um / p1_um
                                                            : displacement_um / denominator_um;
  record_.probed_sd[state_.phase == 2 ? 1 : 0] = sd_um / std::abs(denominator_um);
  move_to(wanted);
}

RunningCorrection::Gains RunningCorrection::slopes() const noexcept {
  Gains slopes{};
  for (std::size_t g = 0; g < groups_; ++g) slopes[g] = state_.contributions_um[g];
  slopes[groups_] = config_.bias_drift_um_per_sqrt_h > 0 ? 1.0 : 0.0;
  return slopes;
}

double RunningCorrection::hours_since_probing() const noexcept {
  return std::max(
      0.0, std::chrono::duration<double, std::ratio<3600>>(state_.now - state_.probed_at).count());
}

double RunningCorrection::joint_sd_um() const noexcept {
  double variance = 0.0;
  for (std::size_t g = 0; g < groups_; ++g)
    variance += state_.contributions_um[g] * state_.contributions_um[g] * joint_variance(g);
  return std::sqrt(variance);
}

double RunningCorrection::sd_um() const noexcept {
  if (course_) return joint_sd_um();
  if (config_.form != CorrectionForm::recursive) return 0.0;
  const Gains h = slopes();
  const double hours = state_.taken == 0 ? 0.0 : hours_since_probing();
  const double gain_drift = config_.gain_drift_per_sqrt_h * config_.gain_drift_per_sqrt_h * hours;
  const double bias_drift =
      config_.bias_drift_um_per_sqrt_h * config_.bias_drift_um_per_sqrt_h * hours;
  double variance = 0.0;
  for (std::size_t i = 0; i <= groups_; ++i) {
    for (std::size_t j = 0; j <= groups_; ++j) variance += h[i] * state_.covariance[i][j] * h[j];
    variance += h[i] * h[i] * (i < groups_ ? gain_drift : bias_drift);
  }
  return std::sqrt(std::max(0.0, variance));
}

void RunningCorrection::learn_recursively(double error_um, double sd_um) noexcept {
  if (state_.taken > 0) {
    const double hours = hours_since_probing();
    for (std::size_t i = 0; i <= groups_; ++i) {
      const double drift =
          i < groups_ ? config_.gain_drift_per_sqrt_h : config_.bias_drift_um_per_sqrt_h;
      state_.covariance[i][i] += drift * drift * hours;
    }
  } else {
    state_.covariance[groups_][groups_] =
        config_.bias_drift_um_per_sqrt_h * config_.bias_drift_um_per_sqrt_h;
  }
  state_.probed_at = state_.now;
  const Gains h = slopes();
  Gains ph{};
  double variance = sd_um * sd_um;
  for (std::size_t i = 0; i <= groups_; ++i)
    for (std::size_t j = 0; j <= groups_; ++j) ph[i] += state_.covariance[i][j] * h[j];
  for (std::size_t i = 0; i <= groups_; ++i) variance += h[i] * ph[i];
  const bool far = !(std::abs(error_um) <= config_.outlier_sigma * std::sqrt(variance));
  const bool agrees = state_.doubted && std::abs(error_um - state_.refused_error_um) <=
                                            agreeing_sigma * std::sqrt(2.0) * sd_um;
  if (far && !agrees) {
    state_.doubted = true;
    state_.refused_error_um = error_um;
    ++state_.refused;
    return;
  }
  state_.doubted = false;
  Gains wanted = state_.learned;
  for (std::size_t i = 0; i <= groups_; ++i) wanted[i] += ph[i] / variance * error_um;
  for (std::size_t i = 0; i <= groups_; ++i)
    for (std::size_t j = 0; j <= groups_; ++j) state_.covariance[i][j] -= ph[i] * ph[j] / variance;
  move_to(wanted);
}

void RunningCorrection::move_to(Gains wanted) noexcept {
  for (std::size_t g = 0; g < groups_; ++g)
    wanted[g] = std::clamp(wanted[g], config_.gain_min, config_.gain_max);
  const double change_um = correction_of(wanted) - correction_of(state_.learned);
  const double share =
      std::abs(change_um) > config_.step_um_max ? config_.step_um_max / std::abs(change_um) : 1.0;
  for (std::size_t i = 0; i <= groups_; ++i)
    state_.learned[i] += share * (wanted[i] - state_.learned[i]);
  for (std::size_t g = 0; g < groups_; ++g)  // rounding may exceed the end
    state_.learned[g] = std::clamp(state_.learned[g], config_.gain_min, config_.gain_max);
  ++state_.taken;
}

void RunningCorrection::restart() noexcept {
  state_.learned[groups_] = state_.used[groups_] = 0.0;
  state_.phase = 1;
  state_.extreme_um = 0.0;
  state_.doubted = false;
  record_.phase.restart();
  record_.looked = false;
}

CorrectionReport RunningCorrection::report() const noexcept {
  CorrectionReport report;
  for (std::size_t g = 0; g < groups_; ++g) {
    report.gain[g] = state_.learned[g];
    report.gain_used[g] = state_.used[g];
    report.gain_sd[g] = std::sqrt(std::max(0.0, state_.covariance[g][g]));
  }
  report.bias_um = groups_ == 0 ? 0.0 : state_.learned[groups_];
  report.bias_used_um = groups_ == 0 ? 0.0 : state_.used[groups_];
  report.sd_um = sd_um();
  report.probing_wanted = report.sd_um > config_.probe_sd_um;
  report.phase = state_.phase;
  report.taken = state_.taken;
  report.refused = state_.refused;
  report.has_record = course_.has_value();
  report.recorded = record_.recorded.gain;
  report.recorded_sd = record_.recorded.sd;
  return report;
}

std::map<std::string, double> RunningCorrection::persistent(const CorrectionReport& report) {
  std::map<std::string, double> values;
  for (std::size_t g = 0; g < correction_groups_max; ++g) {
    if (report.gain[g] == 0.0 && report.gain_sd[g] == 0.0) continue;  // no such group
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
    state_.learned[g] = state_.used[g] = gain;
    // Values learned during a cut wait for its end after a restart too.
    const double gain_used = find(gain_key(g).append("_used"), gain);
    if (is_gain(gain_used)) state_.used[g] = gain_used;
    // The past is unknown after a restart: at most the standard deviation of a first start, never
    // less than before the restart.
    const double sd = find(gain_key(g).append("_sd"), config_.gain_sd);
    if (sd >= 0 && sd <= config_.gain_sd) state_.covariance[g][g] = sd * sd;
  }
  // Several probings may add up to more than one step.
  const auto is_bias = [](double value) { return std::abs(value) <= offset_um_max_of_any_axis; };
  const double bias_um = find("bias_um", 0.0);
  if (groups_ > 0 && is_bias(bias_um)) {
    const double bias_used_um = find("bias_used_um", bias_um);
    state_.learned[groups_] = bias_um;
    state_.used[groups_] = is_bias(bias_used_um) ? bias_used_um : bias_um;
  }
  if (find("phase", 1.0) == 2.0) state_.phase = 2;
}

void RunningCorrection::adopt(const RunningCorrection& previous) noexcept {
  if (config_.form != previous.config_.form || config_.groups != previous.config_.groups) return;
  state_ = previous.state_;
  if (course_ && previous.course_) record_ = previous.record_;
}

}  // namespace thermocomp
