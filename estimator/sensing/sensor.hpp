/// One sensor: screening of its readings before they can move an axis, smoothing of the screened
/// values (source: JPH0736976B2, claims 1, sliding line, and 2, line of lines), and the temperature
/// range of a model column that follows from the screening.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// One sensor after a step, for reports.
struct SensorReport {
  double raw_degC{not_a_number};       ///< as the driver gave it
  double smoothed_degC{not_a_number};  ///< value for the block; a difference where configured
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};     ///< after screening
  std::uint32_t clipped_in_a_row{0};  ///< consecutive values clipped by smoothing
  std::uint64_t clipped{0};
  std::uint64_t rejected{0};  ///< readings refused by screening since the start
  bool waiting{false};        ///< an unconfirmed value is present
  bool jumped{false};         ///< ... because it contradicts earlier or expected values
  double jump_K{0.0};         ///< ... by this much now
  double jumped_from_degC{not_a_number};
  nanoseconds jumped_at{};
  bool suspected{false};     ///< good values that the neighbours contradict
  bool weighed_down{false};  ///< ... and excluded from its blocks
  double suspected_size_K{0.0};
  nanoseconds suspected_since{};

  /// Unconfirmed only because it is new, as every sensor at the start: not a fault.
  [[nodiscard]] bool settles() const noexcept { return fault == Fault::unconfirmed && !jumped; }
};

/// Screens one sensor's readings, each once, when it is new. A refused reading counts as missing:
/// the last confirmed value is used until it is stale.
///
/// A value T follows the last confirmed one, T0, when
///
///     |T - T0| <= rate_allowance_K + max(rate min(t, 2 s), min(rate u, outage_K_max + 10 K/h u)),
///
/// where t is the time since T0 while T0 is in use, and u the time without *any* value. Modules
/// show a change late and as a step, hence the 2 s. A value that does not follow (a jump) adds
/// nothing to u, however long it lasts: it is confirmed by the expectation of its neighbours, by an
/// operator, or by its return to the range that T0 allows. After a jump J, a return may miss by 10
/// K/h since the jump's start, up to J / 4.
///
/// After an outage, and at the start, a value is confirmed by consecutive readings over settle_s,
/// at least settle_readings of them. An exact 0, or raw 0, does not settle: devices send it while
/// not ready.
class Screening {
 public:
  static constexpr std::uint32_t settle_readings = 3;

  explicit Screening(const ScreeningConfig& config);

  /// @return true for a new good reading, available by good_degC() and good_at()
  bool step(nanoseconds now, const Reading& reading) noexcept {
    if (reading.taken_at == state_.seen_at && reading.fault == state_.seen_fault) return false;
    return take(now, reading);
  }

  /// Context of the next readings. The expectation is NaN if no source independent of this sensor
  /// gives one.
  struct Surroundings {
    double expected_degC{not_a_number};
    double expected_sd_K{0.0};
    bool module_not_ready{false};
  };
  void expect(const Surroundings& surroundings) noexcept { surroundings_ = surroundings; }
  /// Before the first reading: the last confirmed value, of unknown age.
  void restore_jump(double from_degC) noexcept;
  /// Confirms the newest value in spite of all checks. @return true if one was waiting
  bool accept() noexcept;

  /// True if the last good reading may still be used at `now`.
  [[nodiscard]] bool usable(nanoseconds now) const noexcept {
    return state_.good.known && now - state_.good.at <= stale_after_;
  }
  /// Fault of the newest reading; none while it is good and fresh.
  [[nodiscard]] Fault fault(nanoseconds now) const noexcept {
    if (state_.verdict != Fault::none) return state_.verdict;
    return now - state_.good.at > stale_after_ ? Fault::stale : Fault::none;
  }
  [[nodiscard]] double good_degC() const noexcept { return state_.good.temp_degC; }
  [[nodiscard]] nanoseconds good_at() const noexcept { return state_.good.at; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return state_.rejected; }
  /// An unconfirmed value is present, or awaited after restore_jump().
  [[nodiscard]] bool waiting() const noexcept { return state_.waiting; }
  [[nodiscard]] bool shows_unconfirmed() const noexcept {
    return state_.waiting && state_.newest.known;
  }
  [[nodiscard]] bool jumped() const noexcept { return state_.jumped; }
  [[nodiscard]] double jump_K() const noexcept {
    return state_.jumped ? state_.newest.temp_degC - state_.jump_from_degC : 0.0;
  }
  /// NaN: no jump.
  [[nodiscard]] double jumped_from_degC() const noexcept {
    return state_.jumped ? state_.jump_from_degC : not_a_number;
  }
  [[nodiscard]] nanoseconds jumped_at() const noexcept { return state_.jumped_at; }
  /// True if the last confirmed value ended a jump without return: the values before it were wrong.
  [[nodiscard]] bool refuted() const noexcept { return state_.refuted; }
  [[nodiscard]] double newest_degC() const noexcept { return state_.newest.temp_degC; }
  [[nodiscard]] bool has_good() const noexcept { return state_.good.known; }

  /// After a reload: the state of `previous` with our limits.
  void adopt(const Screening& previous) noexcept { state_ = previous.state_; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  struct Value {
    bool known{false};
    double temp_degC{0.0};
    nanoseconds at{};
    void visit_state(StateArchive& archive) { archive(known, temp_degC, at); }
  };
  struct State {
    nanoseconds seen_at{};
    Fault seen_fault{Fault::never_read};
    Fault verdict{Fault::never_read};
    bool waiting{false};
    bool jumped{false};
    bool refuted{false};
    Value good;               ///< last confirmed value
    Value newest;             ///< while waiting: the last value in range and fresh
    nanoseconds run_since{};  ///< start of the consecutive values of this kind
    std::uint32_t run_count{0};
    nanoseconds unread{};  ///< time since `good` without any value
    nanoseconds jumped_at{};
    double jump_from_degC{0.0};
    double jump_K_max{0.0};
    nanoseconds same_since{};  ///< since when `newest` has been unchanged to the last bit
    std::uint64_t rejected{0};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p);
    }
  };

  [[nodiscard]] bool take(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] bool is_continuous(nanoseconds now, const Reading& reading) const noexcept;
  /// The last value in range and fresh, confirmed or not.
  [[nodiscard]] const Value& newest() const noexcept {
    return state_.waiting ? state_.newest : state_.good;
  }
  [[nodiscard]] Fault check(nanoseconds now, const Reading& reading) const noexcept;
  void note(const Reading& reading) noexcept;
  [[nodiscard]] Fault judge() noexcept;
  [[nodiscard]] Fault jump(double from_degC) noexcept;
  void count(bool refutes) noexcept;
  [[nodiscard]] double change_K(nanoseconds unread) const noexcept;
  [[nodiscard]] bool possible() const noexcept;
  [[nodiscard]] bool settled() const noexcept;
  [[nodiscard]] bool expected() const noexcept;
  [[nodiscard]] bool unexpected() const noexcept;

  const ScreeningConfig config_;
  const nanoseconds stale_after_;
  const nanoseconds settle_;
  const nanoseconds stuck_after_;  ///< 0: never

  State state_;
  Surroundings surroundings_;  ///< renewed each step while a value waits
};

/// Accepted temperatures of a column; a reference outside was never measured.
class TemperatureRange {
 public:
  /// From all sensors of the column's block; for a difference, the difference of two ranges. A
  /// column without sensors accepts any finite temperature.
  TemperatureRange(const EstimatorConfig& config, const std::string& column);

  [[nodiscard]] bool holds(double temp_degC) const noexcept;  ///< false for NaN
  [[nodiscard]] std::string rule() const;  ///< "must be in [-30, 200], what the screening ..."

 private:
  double degC_min_{not_a_number};
  double degC_max_{not_a_number};
};

/// Stored references outside the range of their column, as text: "reference_degC.t1_degC = 1e+300
/// must be in ...".
[[nodiscard]] std::vector<std::string> impossible_references(
    const EstimatorConfig& config, const std::vector<std::string>& columns,
    const std::map<std::string, double>& reference_degC);

/// Checks the reference of the model file. @throws InvalidValue with the key
void check_reference(const EstimatorConfig& config, const ThermalModel& model);

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

  /// Consecutive values far outside that become the new history if they agree with each other or
  /// lie on one line.
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
