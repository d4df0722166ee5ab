/// Online correction of the model's gains from occasional displacement measurements.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
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
  bool probing_wanted{false};  ///< sd_um is above probe_sd_um
  std::uint8_t phase{1};       ///< two_phase: 1 or 2
  std::uint64_t taken{0};      ///< probings that changed the gains
  std::uint64_t refused{0};    ///< outliers, and probings without information
  bool has_record{false};      ///< the model has a course of this axis; then also:
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
  /// @param may_change  false while cutting: learned values wait
  void step(nanoseconds now, std::span<const double> rise_K, bool may_change) noexcept;
  /// Corrected displacement less the model's [um].
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
  /// Counts a probing without information.
  void refuse() noexcept { ++state_.refused; }
  [[nodiscard]] const Contributions& contributions_um() const noexcept {
    return state_.contributions_um;
  }
  /// Correction with all learned values, in use or not yet [um].
  [[nodiscard]] double learned_um() const noexcept { return correction_of(joint_gains()); }
  /// A new reference: displacements count from here. Gains stay as they are.
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
  /// Variance of a learned gain now; infinite before the first probing since the start.
  [[nodiscard]] double learned_variance(std::size_t group) const noexcept;
  /// Variance of the gain in use: the smaller of the two, since learning started from the record
  /// and is not independent of it.
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

}  // namespace thermocomp
