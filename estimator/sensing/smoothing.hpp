/// Smoothing: values are clipped to a band about a regression line through the recent ones.
/// Source: JPH0736976B2, claims 1 (sliding line) and 2 (line of lines).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

inline constexpr std::size_t smoothing_samples_max = 32;

/// A sample of a temperature or temperature difference.
struct Sample {
  nanoseconds at{};
  double value_K{0.0};
  void visit_state(StateArchive& archive) { archive(at, value_K); }
};

/// value(t) = mean + slope (t - center)
struct Line {
  nanoseconds origin{};  ///< zero of the times in seconds below
  double center_s{0.0};
  double mean_K{0.0};
  double slope_K_per_s{0.0};

  [[nodiscard]] double at(nanoseconds time) const noexcept {
    const double time_s = to_seconds(time - origin);
    return mean_K + slope_K_per_s * (time_s - center_s);
  }
  void visit_state(StateArchive& archive) { archive(origin, center_s, mean_K, slope_K_per_s); }
};

/// Time [s] and value [K] in one SIMD register: half the instructions, same bits.
using TimeAndValue = double __attribute__((vector_size(16)));

/// Ordinary least squares; the slope is 0 where all samples have one time. O(n), in two passes to
/// keep precision at long uptimes. @pre 1 to smoothing_samples_max samples
[[nodiscard]] inline Line fit_line(std::span<const Sample> samples) noexcept {
  const nanoseconds origin = samples.front().at;
  TimeAndValue pairs[smoothing_samples_max];
  TimeAndValue sum{0.0, 0.0};
  std::size_t count = 0;
  for (const Sample& sample : samples) {
    const TimeAndValue pair{to_seconds(sample.at - origin), sample.value_K};
    pairs[count++] = pair;
    sum += pair;
  }
  const TimeAndValue center = sum * (1.0 / static_cast<double>(static_cast<int>(count)));
  TimeAndValue products{0.0, 0.0};  // sums of time squared and of time x value, about the center
  for (std::size_t i = 0; i < count; ++i) {
    const TimeAndValue from_center = pairs[i] - center;
    products += TimeAndValue{from_center[0], from_center[0]} * from_center;
  }
  return {origin, center[0], center[1], products[0] > 0 ? products[1] / products[0] : 0.0};
}

/// The last few samples, oldest first. Each is stored twice, n apart in a ring of 2n, so that the
/// last n are always contiguous.
class SampleHistory {
 public:
  explicit SampleHistory(std::size_t capacity) : capacity_(capacity), samples_(2 * capacity) {}
  void clear() noexcept { size_ = 0; }
  /// Drops the oldest sample when full.
  void push(const Sample& sample) noexcept {
    samples_[next_] = sample;
    samples_[next_ + capacity_] = sample;
    next_ = next_ + 1 == capacity_ ? 0 : next_ + 1;
    if (size_ < capacity_) ++size_;
  }
  [[nodiscard]] bool full() const noexcept { return size_ == capacity_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// @pre not empty
  [[nodiscard]] const Sample& newest() const noexcept { return in_a_row().back(); }
  [[nodiscard]] Line line() const noexcept { return fit_line(in_a_row()); }
  /// Robust spread of the samples around `line`: 1.4826 times the median absolute residual [K].
  [[nodiscard]] double spread_K(const Line& line) const noexcept;
  void visit_state(StateArchive& archive) { archive(size_, next_, samples_); }

 private:
  [[nodiscard]] std::span<const Sample> in_a_row() const noexcept {
    return {samples_.data() + (next_ + capacity_ - size_), size_};
  }

  std::size_t capacity_;
  std::size_t size_{0};
  std::size_t next_{0};  ///< where the next sample goes, below capacity_
  std::vector<Sample> samples_;
};

/// Form A: the line through the last n values, extrapolated to the next one's time.
class SlidingLine {
 public:
  explicit SlidingLine(std::size_t samples) : history_(samples) {}
  [[nodiscard]] bool ready() const noexcept { return history_.full(); }
  [[nodiscard]] Line expected() const noexcept { return history_.line(); }
  [[nodiscard]] double spread_K() const noexcept { return history_.spread_K(history_.line()); }
  void keep(const Sample& sample) noexcept { history_.push(sample); }
  void restart() noexcept { history_.clear(); }
  void visit_state(StateArchive& archive) { archive(history_); }

 private:
  SampleHistory history_;
};

/// Form B: blocks of n values with slopes A_1 (newest), A_2, ..., A_k. The next block's line starts
/// at the newest block's fitted value at its last sample; its slope extrapolates the polynomial of
/// degree k - 1 through the slopes,
///
///     D = sum_i (-1)^(i+1) binomial(k, i) A_i;   k = 3: D = 3A - 3B + C
class LineOfLines {
 public:
  LineOfLines(std::size_t samples, std::size_t blocks);
  [[nodiscard]] bool ready() const noexcept { return blocks_ == wanted_; }
  [[nodiscard]] Line expected() const noexcept { return expected_; }
  [[nodiscard]] double spread_K() const noexcept { return newest_spread_K_; }
  void keep(const Sample& sample) noexcept;
  void restart() noexcept;
  void visit_state(StateArchive& archive) {
    archive(coming_, blocks_, slopes_K_per_s_, newest_spread_K_, expected_);
  }

 private:
  SampleHistory coming_;
  std::size_t wanted_;
  std::size_t blocks_{0};  ///< complete blocks so far, at most wanted_
  std::array<double, smoothing_blocks_max> slopes_K_per_s_{};  ///< the newest first
  double newest_spread_K_{0.0};
  Line expected_;
};

/// Smoothing of one sensor: takes one value per period, clips it to the expected band, keeps the
/// history as configured, restarts after an outage.
class Smoother {
 public:
  explicit Smoother(const SmoothingConfig& config);

  /// Takes a good value when its period is due (always with period 0).
  void add(const Sample& sample) noexcept {
    if (form_ == SmoothingForm::off) {
      value_K_ = sample.value_K;
      has_value_ = true;
      return;
    }
    if (has_value_ && sample.at - taken_at_ > outage_) restart();
    if (due(sample.at)) take(sample);
  }

  /// The next value begins a new history.
  void restart() noexcept;
  [[nodiscard]] bool has_value() const noexcept { return has_value_; }
  [[nodiscard]] double value_K() const noexcept { return value_K_; }
  [[nodiscard]] std::uint64_t clipped() const noexcept { return clipped_; }
  [[nodiscard]] std::uint32_t clipped_in_a_row() const noexcept { return clipped_in_a_row_; }
  void visit_state(StateArchive& archive);

  /// Number of consecutive values far outside that must agree, with each other or on one line, to
  /// become the new history.
  static constexpr std::size_t agreeing_values = 3;
  /// Far outside: this many times the half-width or the robust spread, whichever is larger.
  static constexpr double far_factor = 3.0;

 private:
  [[nodiscard]] bool due(nanoseconds at) noexcept {
    if (!has_value_ || period_ <= nanoseconds{0}) {
      due_at_ = at + period_;
      return true;
    }
    if (at < due_at_) return false;
    // Whole periods, so that late samples do not shift the grid.
    due_at_ += period_ * (1 + (at - due_at_) / period_);
    return true;
  }
  void take(const Sample& sample) noexcept;
  template <class Form>
  void take_into(Form& form, const Sample& sample) noexcept;
  [[nodiscard]] static bool agree(const std::array<Sample, agreeing_values>& far,
                                  double within_K) noexcept;
  template <class Form>
  void keep_screened(Form& form, const Sample& sample, double distance_K) noexcept;

  SmoothingForm form_;
  bool screened_;
  nanoseconds period_;
  nanoseconds outage_;
  double half_width_K_;
  SlidingLine sliding_line_;
  LineOfLines line_of_lines_;

  bool has_value_{false};
  double value_K_{0.0};
  nanoseconds taken_at_{};
  nanoseconds due_at_{};
  std::uint64_t clipped_{0};
  std::uint32_t clipped_in_a_row_{0};
  std::array<Sample, agreeing_values> far_{};  ///< far values waiting for confirmation
  std::size_t far_count_{0};
};

}  // namespace thermocomp
