/// Regression-line expected-band clipper: a value is believed only near where the recent past says
/// it should be. Source: JPH0736976B2, claims 1 (sliding line) and 2 (line of lines).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/line_fit.hpp"
#include "estimator/state_archive.hpp"

namespace thermocomp {

inline constexpr std::size_t smoothing_samples_max = 32;

/// The last few samples, oldest first.
class SampleHistory {
 public:
  explicit SampleHistory(std::size_t capacity) : samples_(capacity) {}
  void clear() noexcept { size_ = 0; }
  /// Drops the oldest sample when full.
  void push(const Sample& sample) noexcept;
  [[nodiscard]] bool full() const noexcept { return size_ == samples_.size(); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// @pre not empty
  [[nodiscard]] const Sample& newest() const noexcept { return samples_[size_ - 1]; }
  [[nodiscard]] Line line() const noexcept { return fit_line({samples_.data(), size_}); }
  /// Robust spread of the samples around `line`: 1.4826 times the median absolute residual [K].
  [[nodiscard]] double spread_K(const Line& line) const noexcept;
  void visit_state(StateArchive& archive) { archive(size_, samples_); }

 private:
  std::vector<Sample> samples_;
  std::size_t size_{0};
};

/// Form A. The line through the last n values, extended to the next one's time.
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

/// Form B. Three blocks of n values with slopes C (oldest), B, A: the coming block's line starts at
/// the newest block's fitted value at its last sample and has slope D = 3A - 3B + C.
class LineOfLines {
 public:
  explicit LineOfLines(std::size_t samples);
  [[nodiscard]] bool ready() const noexcept { return blocks_ == 3; }
  [[nodiscard]] Line expected() const noexcept { return expected_; }
  [[nodiscard]] double spread_K() const noexcept { return newest_spread_K_; }
  void keep(const Sample& sample) noexcept;
  void restart() noexcept;
  void visit_state(StateArchive& archive) {
    archive(coming_, blocks_, slopes_K_per_s_, newest_spread_K_, expected_);
  }

 private:
  SampleHistory coming_;
  std::size_t blocks_{0};                   ///< complete blocks so far, at most 3
  std::array<double, 3> slopes_K_per_s_{};  ///< C, B, A
  double newest_spread_K_{0.0};
  Line expected_;
};

/// One sensor's smoothing: picks one value a period, clips it into the expected band, keeps the
/// history as configured, restarts after an outage.
class Smoother {
 public:
  explicit Smoother(const SmoothingConfig& config);

  /// A new good value. Takes it when its period has come (always with period 0).
  void add(const Sample& sample) noexcept;

  [[nodiscard]] bool has_value() const noexcept { return has_value_; }
  [[nodiscard]] double value_K() const noexcept { return value_K_; }
  [[nodiscard]] std::uint64_t clipped() const noexcept { return clipped_; }
  [[nodiscard]] std::uint32_t clipped_in_a_row() const noexcept { return clipped_in_a_row_; }
  void visit_state(StateArchive& archive);

  /// How many values in a row must be far outside and agree - beside each other, or on one line -
  /// before they become the new history.
  static constexpr std::size_t agreeing_values = 3;
  /// Far outside: this many times the half-width or the robust spread, whichever is larger.
  static constexpr double far_factor = 3.0;

 private:
  [[nodiscard]] bool due(nanoseconds at) noexcept;
  template <class Form>
  void take(Form& form, const Sample& sample) noexcept;
  [[nodiscard]] static bool agree(const std::array<Sample, agreeing_values>& far,
                                  double within_K) noexcept;
  template <class Form>
  void keep_screened(Form& form, const Sample& sample, double distance_K) noexcept;
  void restart() noexcept;

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
  std::array<Sample, agreeing_values> far_{};  ///< far values waiting to be believed
  std::size_t far_count_{0};
};

}  // namespace thermocomp
