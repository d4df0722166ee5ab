#include "estimator/sensing/sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// Fastest change of a machine's structure over hours.
constexpr double slow_K_per_ns = 10.0 / 3600.0 * 1e-9;
/// Largest miss of a return, as a share of the jump.
constexpr double return_share = 0.25;
/// Largest standard deviation, as a share of the allowance, of an expectation that can confirm.
constexpr double expectation_share = 0.5;
/// An expectation contradicts beyond this many standard deviations and the allowance.
constexpr double unexpected_sd = 2.5;

/// Modules filter, and renew values once a second or less often: a change appears late, as a step.
constexpr nanoseconds shown_late_max = std::chrono::seconds{2};

/// Half of min(), so that differences do not overflow.
constexpr nanoseconds long_ago = nanoseconds::min() / 2;

}  // namespace

Screening::Screening(const ScreeningConfig& config)
    : config_(config),
      stale_after_(to_nanoseconds(config.stale_after_s)),
      settle_(to_nanoseconds(config.settle_s)),
      stuck_after_(to_nanoseconds(config.stuck_after_s)) {
  config.validate();
}

bool Screening::take(nanoseconds now, const Reading& reading) noexcept {
  state_.seen_at = reading.taken_at;
  state_.seen_fault = reading.fault;
  if (is_continuous(now, reading)) {
    if (reading.temp_degC != state_.good.temp_degC) state_.same_since = reading.taken_at;
    state_.good = {true, reading.temp_degC, reading.taken_at};
    state_.verdict = Fault::none;
    state_.refuted = false;
    return true;
  }
  state_.verdict = check(now, reading);
  if (state_.verdict == Fault::none) {
    note(reading);
    state_.verdict = judge();
  }
  if (state_.verdict == Fault::none) return true;
  const bool only_settling =
      reading.fault == Fault::none && state_.verdict == Fault::unconfirmed && !state_.jumped;
  if (state_.verdict != Fault::never_read && !only_settling) ++state_.rejected;
  return false;
}

/// Fast path for most readings: near the previous one, which was confirmed. Times are compared
/// without differences, which could overflow.
bool Screening::is_continuous(nanoseconds now, const Reading& reading) const noexcept {
  return reading.fault == Fault::none && !state_.waiting && state_.good.known &&
         std::abs(reading.temp_degC - state_.good.temp_degC) <= config_.rate_allowance_K &&
         reading.temp_degC >= config_.temp_degC_min && reading.temp_degC <= config_.temp_degC_max &&
         reading.taken_at > state_.good.at && reading.taken_at <= state_.good.at + stale_after_ &&
         reading.taken_at >= now - stale_after_ && reading.taken_at <= now + stale_after_ &&
         stuck_after_ <= nanoseconds{0};
}

Fault Screening::check(nanoseconds now, const Reading& reading) const noexcept {
  if (reading.fault != Fault::none) return reading.fault;
  // Written so that NaN fails.
  if (!(reading.temp_degC >= config_.temp_degC_min && reading.temp_degC <= config_.temp_degC_max))
    return Fault::out_of_range;
  // A time far in the future would make every later reading look old.
  if (!(reading.taken_at >= now - stale_after_ && reading.taken_at <= now + stale_after_))
    return Fault::stale;
  // A late or duplicated reading has no new information.
  if (newest().known && reading.taken_at <= newest().at) return Fault::stale;
  return Fault::none;
}

/// Records the sequence of values, confirmed or not.
void Screening::note(const Reading& reading) noexcept {
  const Value before = newest();
  const nanoseconds gap = before.known ? reading.taken_at - before.at : nanoseconds{0};
  const double step_K = std::abs(reading.temp_degC - before.temp_degC);
  if (!(before.known && gap <= stale_after_ &&
        step_K <= config_.rate_allowance_K + change_K(gap))) {
    state_.run_since = reading.taken_at;
    state_.run_count = 0;
  }
  ++state_.run_count;
  if (!before.known || reading.temp_degC != before.temp_degC) state_.same_since = reading.taken_at;
  if (!state_.waiting)
    state_.unread = reading.taken_at - state_.good.at;
  else if (gap > stale_after_)
    state_.unread += gap;
  state_.newest = {true, reading.temp_degC, reading.taken_at};
}

Fault Screening::judge() noexcept {
  const nanoseconds at = state_.newest.at;
  if (state_.good.known && !possible()) return jump(state_.good.temp_degC);
  if (!(state_.good.known && at - state_.good.at <= stale_after_)) {
    if (unexpected()) return jump(surroundings_.expected_degC);
    state_.waiting = true;
    if (!settled()) return Fault::unconfirmed;
  }
  if (stuck_after_ > nanoseconds{0} && at - state_.same_since > stuck_after_) return Fault::stuck;
  count(false);
  return Fault::none;
}

/// Reports a newest value that contradicts an earlier or expected one.
Fault Screening::jump(double from_degC) noexcept {
  const nanoseconds at = state_.newest.at;
  if (!state_.jumped) {
    state_.jumped_at = at;
    state_.jump_from_degC = from_degC;
    state_.jump_K_max = 0.0;
  }
  state_.waiting = state_.jumped = true;
  state_.jump_K_max = std::max(state_.jump_K_max, std::abs(jump_K()));
  if (settled() && expected()) {
    count(true);
    return Fault::none;
  }
  const bool good_serves = state_.good.known && at - state_.good.at <= stale_after_;
  return good_serves ? Fault::too_fast : Fault::unconfirmed;
}

void Screening::count(bool refutes) noexcept {
  state_.good = state_.newest;
  state_.waiting = state_.jumped = false;
  state_.refuted = refutes;
  surroundings_ = {};  // renewed for the next wait
}

void Screening::restore_jump(double from_degC) noexcept {
  if (!(from_degC >= config_.temp_degC_min && from_degC <= config_.temp_degC_max)) return;
  state_.good = {true, from_degC, long_ago};
  state_.waiting = true;
}

bool Screening::accept() noexcept {
  if (!state_.waiting || !state_.newest.known) return false;
  if (state_.seen_fault == Fault::none) state_.verdict = Fault::none;
  count(state_.jumped);
  return true;
}

double Screening::change_K(nanoseconds unread) const noexcept {
  const auto unread_ns = static_cast<double>(unread.count());
  return std::min(config_.rate_K_per_s_max * 1e-9 * unread_ns,
                  config_.outage_K_max + slow_K_per_ns * unread_ns);
}

/// True if the structure can have reached the newest value from the last confirmed one.
bool Screening::possible() const noexcept {
  const double off_K = std::abs(state_.newest.temp_degC - state_.good.temp_degC);
  const nanoseconds since_good = state_.newest.at - state_.good.at;
  const nanoseconds late =
      since_good <= stale_after_ ? std::min(since_good, shown_late_max) : nanoseconds{0};
  const double shown_late_K = config_.rate_K_per_s_max * 1e-9 * static_cast<double>(late.count());
  const double allowed_K =
      config_.rate_allowance_K + std::max(change_K(state_.unread), shown_late_K);
  // An outage does not explain an error that was as large before it.
  const bool is_still_off = state_.jumped && off_K > config_.rate_allowance_K + shown_late_K &&
                            std::abs(off_K - state_.jump_K_max) <= config_.rate_allowance_K;
  if (off_K <= allowed_K && !is_still_off) return true;
  if (!state_.jumped) return false;
  const auto jumped_ns = static_cast<double>((state_.newest.at - state_.jumped_at).count());
  return off_K <= return_share * state_.jump_K_max &&
         off_K <= allowed_K + slow_K_per_ns * jumped_ns;
}

bool Screening::settled() const noexcept {
  if (settle_ <= nanoseconds{0}) return true;
  return state_.run_count >= settle_readings && state_.newest.at - state_.run_since >= settle_ &&
         state_.newest.temp_degC != 0.0 && state_.newest.temp_degC != config_.raw_0_degC &&
         !surroundings_.module_not_ready;
}

bool Screening::expected() const noexcept {
  return surroundings_.expected_sd_K <= expectation_share * config_.rate_allowance_K &&
         std::abs(state_.newest.temp_degC - surroundings_.expected_degC) <=
             config_.rate_allowance_K;
}

/// True if the expectation contradicts; false without one.
bool Screening::unexpected() const noexcept {
  return std::abs(state_.newest.temp_degC - surroundings_.expected_degC) >
         std::max(config_.rate_allowance_K, unexpected_sd * surroundings_.expected_sd_K);
}

namespace {

std::string to_text(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

}  // namespace

TemperatureRange::TemperatureRange(const EstimatorConfig& config, const std::string& column) {
  for (const BlockConfig& block : config.blocks) {
    if (block.input != column) continue;
    for (const std::size_t index : block.sensors) {
      // A configuration that is still being checked may name missing sensors.
      if (index >= config.sensors.size()) continue;
      const SensorConfig& sensor = config.sensors[index];
      double low = sensor.screening.temp_degC_min;
      double high = sensor.screening.temp_degC_max;
      if (sensor.reference_sensor) {
        const ScreeningConfig& other = config.sensors[*sensor.reference_sensor].screening;
        low -= other.temp_degC_max;
        high -= other.temp_degC_min;
      }
      degC_min_ = std::isnan(degC_min_) ? low : std::min(degC_min_, low);
      degC_max_ = std::isnan(degC_max_) ? high : std::max(degC_max_, high);
    }
  }
}

bool TemperatureRange::holds(double temp_degC) const noexcept {
  if (std::isnan(degC_min_)) return std::isfinite(temp_degC);
  return temp_degC >= degC_min_ && temp_degC <= degC_max_;
}

std::string TemperatureRange::rule() const {
  if (std::isnan(degC_min_)) return "must be a finite number";
  std::string text("must be in [");
  text.append(to_text(degC_min_)).append(", ").append(to_text(degC_max_));
  return text.append("], what the screening of its sensors lets through");
}

std::vector<std::string> impossible_references(
    const EstimatorConfig& config, const std::vector<std::string>& columns,
    const std::map<std::string, double>& reference_degC) {
  std::vector<std::string> refused;
  for (const std::string& column : columns) {
    const auto found = reference_degC.find(column);
    if (found == reference_degC.end() || std::isnan(found->second)) continue;
    const TemperatureRange range(config, column);
    if (range.holds(found->second)) continue;
    std::string text("reference_degC.");
    text.append(column).append(" = ").append(to_text(found->second));
    refused.push_back(text.append(" ").append(range.rule()));
  }
  return refused;
}

void check_reference(const EstimatorConfig& config, const ThermalModel& model) {
  for (std::size_t i = 0; i < model.reference_degC.size(); ++i) {
    const TemperatureRange range(config, model.inputs[i]);
    std::string key("reference[");
    key.append(std::to_string(i)).append("]");
    require(range.holds(model.reference_degC[i]), key.c_str(), model.reference_degC[i],
            range.rule().c_str());
  }
}

double SampleHistory::spread_K(const Line& line) const noexcept {
  std::array<double, smoothing_samples_max> residuals_K{};
  std::size_t count = 0;
  for (const Sample& sample : in_a_row())
    residuals_K[count++] = std::abs(sample.value_K - line.at(sample.at));
  const auto begin = residuals_K.begin();
  const auto middle = begin + static_cast<std::ptrdiff_t>(size_ / 2);
  std::nth_element(begin, middle, begin + static_cast<std::ptrdiff_t>(size_));
  constexpr double normal_sigma_per_median = 1.4826;
  return normal_sigma_per_median * *middle;
}

LineOfLines::LineOfLines(std::size_t samples, std::size_t blocks)
    : coming_(samples), wanted_(blocks) {}

void LineOfLines::keep(const Sample& sample) noexcept {
  coming_.push(sample);
  if (!coming_.full()) return;
  const Line newest = coming_.line();
  std::copy_backward(slopes_K_per_s_.begin(), slopes_K_per_s_.end() - 1, slopes_K_per_s_.end());
  slopes_K_per_s_[0] = newest.slope_K_per_s;
  blocks_ = std::min(blocks_ + 1, wanted_);
  newest_spread_K_ = coming_.spread_K(newest);
  const nanoseconds last = coming_.newest().at;
  double slope_K_per_s = 0.0;
  double factor = -1.0;  // (-1)^(i+1) binomial(k, i), i from 1
  for (std::size_t i = 1; i <= wanted_; ++i) {
    factor *= -static_cast<double>(wanted_ + 1 - i) / static_cast<double>(i);
    slope_K_per_s += factor * slopes_K_per_s_[i - 1];
  }
  expected_ = {last, 0.0, newest.at(last), slope_K_per_s};
  coming_.clear();
}

void LineOfLines::restart() noexcept {
  coming_.clear();
  blocks_ = 0;
}

Smoother::Smoother(const SmoothingConfig& config)
    : form_(config.form),
      screened_(config.history == SmoothingHistory::screened),
      period_(to_nanoseconds(config.period_s)),
      outage_(std::max(to_nanoseconds(config.outage_s), 2 * period_)),
      half_width_K_(config.half_width_K),
      sliding_line_(config.samples),
      line_of_lines_(config.samples, config.blocks) {
  config.validate();
  THERMOCOMP_ENSURE(config.samples <= smoothing_samples_max);
}

void Smoother::take(const Sample& sample) noexcept {
  taken_at_ = sample.at;
  if (form_ == SmoothingForm::sliding_line)
    take_into(sliding_line_, sample);
  else
    take_into(line_of_lines_, sample);
  has_value_ = true;
}

template <class Form>
void Smoother::take_into(Form& form, const Sample& sample) noexcept {
  if (!form.ready()) {
    value_K_ = sample.value_K;
    clipped_in_a_row_ = 0;
    form.keep(sample);
    return;
  }
  const double expected_K = form.expected().at(sample.at);
  const double distance_K = sample.value_K - expected_K;
  value_K_ = std::clamp(sample.value_K, expected_K - half_width_K_, expected_K + half_width_K_);
  if (std::abs(distance_K) <= half_width_K_) {
    clipped_in_a_row_ = 0;
  } else {
    ++clipped_;
    ++clipped_in_a_row_;
  }
  if (screened_)
    keep_screened(form, sample, distance_K);
  else
    form.keep(sample);
}

bool Smoother::agree(const std::array<Sample, agreeing_values>& far, double within_K) noexcept {
  const auto& [first, second, third] = far;
  const double step_K = second.value_K - first.value_K;
  if (std::abs(step_K) <= within_K && std::abs(third.value_K - second.value_K) <= within_K)
    return true;
  // Values on a steep line agree although they are far from each other.
  const auto way = static_cast<double>((third.at - second.at).count());
  const auto first_way = static_cast<double>((second.at - first.at).count());
  return first_way > 0 &&
         std::abs(second.value_K + step_K * way / first_way - third.value_K) <= within_K;
}

template <class Form>
void Smoother::keep_screened(Form& form, const Sample& sample, double distance_K) noexcept {
  const auto far_K = [&] { return far_factor * std::max(half_width_K_, form.spread_K()); };
  if (std::abs(distance_K) <= half_width_K_ || std::abs(distance_K) <= far_K()) {
    far_count_ = 0;
    form.keep(sample);
    return;
  }
  far_[far_count_] = sample;
  ++far_count_;
  if (far_count_ < agreeing_values) return;
  if (!agree(far_, far_K())) {
    // The newest values may begin a consistent run.
    std::copy(far_.begin() + 1, far_.end(), far_.begin());
    --far_count_;
    return;
  }
  // Consistent: the temperature has changed, and the history restarts with these values.
  form.restart();
  for (const Sample& far : far_) form.keep(far);
  far_count_ = 0;
  value_K_ = sample.value_K;
}

void Smoother::restart() noexcept {
  sliding_line_.restart();
  line_of_lines_.restart();
  has_value_ = false;
  clipped_in_a_row_ = 0;
  far_count_ = 0;
}

void Smoother::visit_state(StateArchive& archive) {
  archive(has_value_, value_K_, taken_at_, due_at_, clipped_, clipped_in_a_row_, far_, far_count_,
          sliding_line_, line_of_lines_);
}

}  // namespace thermocomp
