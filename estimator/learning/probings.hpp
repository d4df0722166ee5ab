/// Displacements measured at the tool: online correction of the model's gains per axis, error of
/// the model, and the check of a manually entered value against the model's claimed error.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/learning/recorded_course.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// State of one axis' correction, for reports.
struct CorrectionReport {
  std::array<double, correction_groups_max> gain{};       ///< learned, one per group
  std::array<double, correction_groups_max> gain_used{};  ///< in use; mid-cut those from before it
  std::array<double, correction_groups_max> gain_sd{};    ///< as of the last probing
  double bias_um{0.0};
  double bias_used_um{0.0};
  double sd_um{0.0};           ///< of the corrected displacement now, from the gains
  bool probing_wanted{false};  ///< sd_um exceeds probe_sd_um
  std::uint8_t phase{1};       ///< two_phase: 1 or 2
  std::uint64_t taken{0};      ///< probings that changed the gains
  std::uint64_t refused{0};    ///< outliers, and probings without information
  bool has_record{false};      ///< the model has a course of this axis; only then valid:
  std::array<double, correction_groups_max> recorded{};     ///< recorded gains at the present state
  std::array<double, correction_groups_max> recorded_sd{};  ///< ... and their standard deviations
};

/// One axis. With contributions p_g = sum over the inputs of group g of matrix * rise, and model
/// output d of the estimator: d_corrected = d + sum_g (R_g - 1) p_g + bias.
///
/// two_phase (Teratani et al. 1995; group 1: heat source, group 2: tie):
///   phase 1   R_1 = (d_ex - d + p_1) / p_1        R_2 = 1
///             or as printed: R_1 = d_ex / d (eq. 34), R_1 = d_ex / p_1 (eq. 31)
///   phase 2   R_1 stays, R_2 = (d_ex - d + p_2 - (R_1 - 1) p_1) / p_2
/// Phase 2 begins when the measured displacement has come back by turn_um. A p below
/// contribution_um_min changes nothing.
///
/// constant: the earlier form d = Ki (A - B) - Ci: bias = d_ex - d, the gains stay.
///
/// recursive: a Kalman filter whose state is the gains (and a bias) as random walks of
/// gain_drift_per_sqrt_h; a probing beyond outlier_sigma is refused unless the next one agrees.
///
/// With a recorded course (`[course]` of the model) the gains in use are the mean of the learned
/// and the recorded gains at the present state, weighted by their variances. The variance of a
/// learned gain grows with gain_drift_per_sqrt_h, from noise_um / |p_g| at the last probing
/// (two_phase) or from the filter (recursive). A probing starts from the gains in use.
///
/// A probing moves the estimate by at most step_um_max, the gains stay in [gain_min, gain_max], and
/// learned values are not used before `may_change`.
class RunningCorrection {
 public:
  using Contributions = std::array<double, correction_groups_max>;

  /// @throws InvalidValue when a group names no input of the model, or one twice
  RunningCorrection(const CorrectionConfig& config, const ThermalModel& model, std::size_t output);

  /// @param rise_K      of the model's temperature columns
  /// @param may_change  false while cutting: learned values are not used yet
  void step(nanoseconds now, std::span<const double> rise_K, bool may_change) noexcept;
  /// Displacement with correction minus that of the model [um].
  [[nodiscard]] double correction_um() const noexcept { return correction_of(state_.used); }
  /// The same at another state of the machine.
  [[nodiscard]] double correction_um(std::span<const double> rise_K) const noexcept {
    return correction_of(state_.used, contributions_um(rise_K));
  }
  struct Measured {
    double displacement_um{0.0};  ///< measured, without any offset
    double model_um{0.0};         ///< of the model at the same time, without correction
    double sd_um{0.0};            ///< 0: noise_um
    std::optional<Contributions> contributions_um{};  ///< at that time; none: now
  };
  void measured(const Measured& measured) noexcept;
  /// Counts a probing from which nothing can be learned.
  void refuse() noexcept { ++state_.refused; }
  [[nodiscard]] const Contributions& contributions_um() const noexcept {
    return state_.contributions_um;
  }
  /// Correction with all learned values, in use or not yet [um].
  [[nodiscard]] double learned_um() const noexcept { return correction_of(joint_gains()); }
  /// A new reference: displacements count from it. Gains do not change.
  void restart() noexcept;

  [[nodiscard]] CorrectionReport report() const noexcept;
  /// Gains by name ("gain1", ...), as in `report`, and those in use where they differ; allocates.
  [[nodiscard]] static std::map<std::string, double> persistent(const CorrectionReport& report);
  /// Before the first step, from "AXIS.gain1" and so on. Values that cannot be gains are ignored.
  void restore(const std::map<std::string, double>& of_all_axes, const std::string& axis);
  /// After a reload, if form and groups are the same.
  void adopt(const RunningCorrection& previous) noexcept;

  void visit_state(StateArchive& archive) {
    archive(state_);
    if (course_) archive(record_);
  }

 private:
  static constexpr std::size_t states_max = correction_groups_max + 1;
  using Gains = std::array<double, states_max>;  ///< gains, then the bias
  struct State {
    Gains used{};
    Gains learned{};
    std::array<Gains, states_max> covariance{};
    Contributions contributions_um{};
    nanoseconds now{};
    nanoseconds probed_at{};
    double refused_error_um{0.0};
    bool doubted{false};  ///< the last probing was refused as an outlier
    std::uint8_t phase{1};
    double extreme_um{0.0};  ///< of the measured displacement in phase 1, by magnitude
    std::uint64_t taken{0};
    std::uint64_t refused{0};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l);
    }
  };

  /// State of the look-up; archived only with a course, so that other states keep their layout.
  struct Record {
    explicit Record(double back_um) : phase(back_um) {}
    HeatPhase phase;
    RecordedGains recorded{};
    bool looked{false};
    nanoseconds looked_at{};
    Contributions probed_sd{};  ///< standard deviation of the learned gains at the last probing
    void visit_state(StateArchive& archive) {
      archive(phase, recorded.gain, recorded.sd, looked, looked_at, probed_sd);
    }
  };

  void look_up(std::span<const double> rise_K) noexcept;
  /// Present variance of a learned gain; infinite before the first probing since the start.
  [[nodiscard]] double learned_variance(std::size_t group) const noexcept;
  /// Variance of the gain in use: the smaller of learned and recorded, which are not independent
  /// since learning started from the record.
  [[nodiscard]] double joint_variance(std::size_t group) const noexcept;
  /// Learned gains, joined with those of the course if there is one.
  [[nodiscard]] Gains joint_gains() const noexcept;
  void go_on_from_joint() noexcept;
  [[nodiscard]] Contributions contributions_um(std::span<const double> rise_K) const noexcept;
  [[nodiscard]] double correction_of(const Gains& state, const Contributions& of_um) const noexcept;
  [[nodiscard]] double correction_of(const Gains& state) const noexcept {
    return correction_of(state, state_.contributions_um);
  }
  [[nodiscard]] Gains slopes() const noexcept;
  [[nodiscard]] double sd_um() const noexcept;
  [[nodiscard]] double joint_sd_um() const noexcept;
  [[nodiscard]] double hours_since_probing() const noexcept;
  void learn_two_phases(double displacement_um, double model_um, double sd_um) noexcept;
  void learn_recursively(double error_um, double sd_um) noexcept;
  void move_to(Gains wanted) noexcept;

  const CorrectionConfig config_;
  std::vector<std::vector<std::size_t>> inputs_;      ///< of each group
  std::vector<std::vector<double>> matrix_um_per_K_;  ///< the same shape
  const std::size_t groups_;
  std::optional<CourseLookup> course_;

  State state_;
  Record record_;
};

/// Mean square of the last probings: of all up to 20, then with weight 1/20 for each new one.
class ProbedError {
 public:
  void take(double error_um) noexcept {
    if (!std::isfinite(error_um)) return;
    ++count_;
    const double weight = 1.0 / static_cast<double>(std::min<std::uint64_t>(count_, 20));
    mean_square_um2_ += weight * (error_um * error_um - mean_square_um2_);
  }
  [[nodiscard]] double rms_um() const noexcept {
    return count_ > 0 ? std::sqrt(mean_square_um2_) : not_a_number;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  void visit_state(StateArchive& archive) { archive(count_, mean_square_um2_); }

 private:
  std::uint64_t count_{0};
  double mean_square_um2_{0.0};
};

/// Standard deviations beyond which the operator is asked.
inline constexpr double question_sigma = 3.0;

/// Displacements at the newest probing [um]; NaN: the axis has none since the reference.
struct LastProbing {
  double without_offset_um{not_a_number};  ///< displacement
  double model_um{not_a_number};           ///< of the model in use at that time, alone

  /// True if the model explains less than half of the displacement, beyond the noise of a probing.
  [[nodiscard]] bool is_unexplained(double noise_um) const noexcept {
    const double error_um = std::abs(without_offset_um - model_um);
    return error_um > question_sigma * noise_um && error_um > 0.5 * std::abs(without_offset_um);
  }
  void visit_state(StateArchive& archive) { archive(without_offset_um, model_um); }
};

/// Input error that explains a value which contradicts the model's claimed error.
enum class EntryError : std::uint8_t {
  none,     ///< the value agrees
  sign,     ///< its negative agrees
  tenfold,  ///< a tenth of it agrees
  tenth,    ///< ten times it agrees
  unexplained
};

/// @param sd_um  of the difference between model and measurement; NaN: no claimed error
[[nodiscard]] inline EntryError entry_error_of(double value_um, double expected_um,
                                               double sd_um) noexcept {
  if (!std::isfinite(sd_um) || !std::isfinite(expected_um)) return EntryError::none;
  const auto agrees = [&](double value) {
    return std::abs(value - expected_um) <= question_sigma * sd_um;
  };
  if (agrees(value_um)) return EntryError::none;
  if (agrees(-value_um)) return EntryError::sign;
  if (agrees(0.1 * value_um)) return EntryError::tenfold;
  if (agrees(10.0 * value_um)) return EntryError::tenth;
  return EntryError::unexplained;
}

[[nodiscard]] constexpr std::string_view text_of(EntryError entry_error) noexcept {
  switch (entry_error) {
    case EntryError::none:
      return "";
    case EntryError::sign:
      return "the opposite sign would fit";
    case EntryError::tenfold:
      return "a tenth of it would fit";
    case EntryError::tenth:
      return "ten times it would fit";
    case EntryError::unexplained:
      break;
  }
  return "perhaps another axis or another tool";
}

/// Offsets entered at the controller since the reference, as displacement of the axis. They stay in
/// effect there, so the correction must not compensate the same displacement again.
struct OperatorOffset {
  double entered_um{0.0};
  double absorbed_um{0.0};  ///< part of the correction in use
  double learned_um{0.0};   ///< ... with the part that waits for the end of a cut
};

/// State of an axis at an earlier time, for a part that is measured later.
struct PastMoment {
  nanoseconds at{};
  double compensated_um{not_a_number};
  double model_um{not_a_number};
  double entered_um{0.0};
  RunningCorrection::Contributions contributions_um{};
};

/// A displacement measured at the tool.
struct MeasuredValue {
  double value_um{0.0};  ///< remaining or total displacement, see [correction] measured
  double sd_um{0.0};     ///< 0: as configured
  MeasuredSource source{MeasuredSource::probe};
};

class Probings {
 public:
  static constexpr std::size_t past_moments = 121;
  static constexpr std::chrono::minutes past_pitch{1};

  /// @param axis_output  axis -> output of the model
  /// @throws InvalidValue as RunningCorrection
  Probings(const EstimatorConfig& config, const ThermalModel& model,
           const std::vector<std::size_t>& axis_output);

  /// @param may_change  false: learned values are not used before the end of the cut
  void step(nanoseconds now, std::span<const double> temps_degC,
            std::span<const double> reference_degC, bool may_change) noexcept;
  /// Correction of the model's displacement, less the part entered at the controller [um].
  [[nodiscard]] double correction_um(std::size_t axis) const noexcept {
    return corrections_[axis].correction_um() - operator_um_[axis].absorbed_um;
  }
  /// The same at another state of the machine.
  [[nodiscard]] double correction_um(std::size_t axis,
                                     std::span<const double> rise_K) const noexcept {
    return corrections_[axis].correction_um(rise_K) - operator_um_[axis].absorbed_um;
  }

  /// Displacement without any offset, from a measured value [um].
  [[nodiscard]] double without_offset_um(double value_um, const PastMoment& moment) const noexcept {
    return meaning_ == MeasuredMeaning::remaining
               ? value_um - moment.compensated_um + moment.entered_um
               : value_um;
  }

  /// Records a value from an operator or a probe, even if nothing can be learned from it.
  void note(std::size_t axis, double value_um) noexcept { measured_um_[axis] = value_um; }
  /// @param moment  state of the axis at the time of the measurement; see past()
  void learn(std::size_t axis, const MeasuredValue& measured, const PastMoment& moment) noexcept;
  /// Present state of the axis, with contributions and entered offset.
  [[nodiscard]] PastMoment present(std::size_t axis, double compensated_um,
                                   double model_um) const noexcept;
  /// Stored state nearest to `at`; nullptr: none near.
  [[nodiscard]] const PastMoment* past(std::size_t axis, nanoseconds at) const noexcept;
  [[nodiscard]] bool must_remember(nanoseconds now) const noexcept {
    return is_on_ && now - remembered_at_ >= past_pitch;
  }
  /// Reach of past(), if no state was unknown in between.
  [[nodiscard]] std::chrono::minutes remembered() const noexcept {
    return past_pitch * static_cast<int>(remembered_);
  }
  /// Once for each axis, with the same time.
  void remember(std::size_t axis, const PastMoment& moment) noexcept;
  /// Counts a value from which nothing can be learned.
  void refuse(std::size_t axis) noexcept { corrections_[axis].refuse(); }
  /// A new reference: displacements count from it.
  void restart() noexcept;

  [[nodiscard]] double measured_um(std::size_t axis) const noexcept { return measured_um_[axis]; }
  [[nodiscard]] const OperatorOffset& operator_um(std::size_t axis) const noexcept {
    return operator_um_[axis];
  }
  [[nodiscard]] const LastProbing& last(std::size_t axis) const noexcept { return last_[axis]; }
  [[nodiscard]] double rms_um(std::size_t axis) const noexcept { return errors_[axis].rms_um(); }
  [[nodiscard]] std::uint64_t count(std::size_t axis) const noexcept {
    return errors_[axis].count();
  }
  [[nodiscard]] CorrectionReport report(std::size_t axis) const noexcept {
    return corrections_[axis].report();
  }

  /// Before the first step; see RunningCorrection::restore().
  void restore(const std::map<std::string, double>& corrections);
  /// @param axes  from plan_names()
  void adopt(const Probings& previous, const std::vector<int>& axes) noexcept;
  /// Takes over the error of probings, which belongs to a model.
  void adopt_errors(const Probings& previous, const std::vector<int>& axes) noexcept;
  void visit_learned(StateArchive& archive);
  void visit_measured(StateArchive& archive) { archive(measured_um_, last_); }
  void visit_operators(StateArchive& archive);

 private:
  const std::vector<std::string> axis_names_;
  const bool is_on_;
  const MeasuredMeaning meaning_;

  std::vector<RunningCorrection> corrections_;  ///< one per axis, as are the next three
  std::vector<ProbedError> errors_;
  std::vector<LastProbing> last_;
  std::vector<double> measured_um_;
  std::vector<OperatorOffset> operator_um_;
  std::vector<PastMoment> past_;  ///< rings of past_moments, one per axis; empty: no correction
  std::size_t next_past_{0};
  std::size_t remembered_{0};  ///< kept moments of each axis
  nanoseconds remembered_at_{-past_pitch};
  std::vector<double> rise_K_;  ///< scratch, one per column
};

}  // namespace thermocomp
