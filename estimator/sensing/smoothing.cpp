#include "estimator/sensing/smoothing.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {

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
    // The newest values may begin a run that agrees.
    std::copy(far_.begin() + 1, far_.end(), far_.begin());
    --far_count_;
    return;
  }
  // They agree: the temperature has changed, and the history restarts with them.
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
