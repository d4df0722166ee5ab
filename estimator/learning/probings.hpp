/// Displacements measured at the tool: correction learned per axis, error of the model, and the
/// check of a manually entered value against the model's claimed error.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/learning/running_correction.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

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

/// Input error that explains a value which contradicts the model's claimed error.
enum class EntryError : std::uint8_t {
  none,     ///< the value agrees
  sign,     ///< its negative agrees
  tenfold,  ///< a tenth of it agrees
  tenth,    ///< ten times it agrees
  unexplained
};

/// Standard deviations beyond which the operator is asked.
inline constexpr double question_sigma = 3.0;

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

/// Offsets entered at the controller since the reference, as displacement of the axis. They stay
/// there, so the correction must not compensate the same displacement again.
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

  /// @param may_change  false: learned values wait for the end of the cut
  void step(nanoseconds now, const Temperatures& temps, const ReferenceState& reference,
            bool may_change) noexcept;
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

  /// Records a value from an operator or a probe, also if nothing can be learned from it.
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
  /// A new reference: displacements count from here.
  void restart() noexcept;

  [[nodiscard]] double measured_um(std::size_t axis) const noexcept { return measured_um_[axis]; }
  [[nodiscard]] const OperatorOffset& operator_um(std::size_t axis) const noexcept {
    return operator_um_[axis];
  }
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
  void visit_learned(StateArchive& archive);
  void visit_measured(StateArchive& archive) { archive(measured_um_); }
  void visit_operators(StateArchive& archive);

 private:
  const std::vector<std::string> axis_names_;
  const bool is_on_;
  const MeasuredMeaning meaning_;

  std::vector<RunningCorrection> corrections_;  ///< one per axis, as are the next two
  std::vector<ProbedError> errors_;
  std::vector<double> measured_um_;
  std::vector<OperatorOffset> operator_um_;
  std::vector<PastMoment> past_;  ///< rings of past_moments, one per axis; empty: no correction
  std::size_t next_past_{0};
  std::size_t remembered_{0};  ///< kept moments of each axis
  nanoseconds remembered_at_{-past_pitch};
  std::vector<double> rise_K_;  ///< scratch, one per column
};

}  // namespace thermocomp
