/// Configuration of the estimator, filled by config/ or by a test.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/checks.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

inline constexpr std::size_t correction_groups_max = 4;

enum class CorrectionForm {
  off,
  two_phase,
  recursive,
  constant  ///< Ci of the earlier form Ki (A - B) - Ci; the gains stay
};
/// First gain of two_phase (Teratani et al. 1995).
enum class FirstGain {
  consistent,  ///< the estimate becomes the measured value
  eq_34,       ///< measured / predicted: valid only while the tie is cold
  eq_31        ///< measured / the heat source's share: valid only while the tie is cold
};
/// Meaning of a `measured` value: displacement that remains at the tool with the offset in effect,
/// or the displacement without any offset.
enum class MeasuredMeaning { remaining, total };

struct CorrectionConfig {
  CorrectionForm form{CorrectionForm::off};
  /// Inputs that share a gain. two_phase: two groups, heat source and tie.
  std::vector<std::vector<std::string>> groups;
  MeasuredMeaning measured{MeasuredMeaning::remaining};
  FirstGain first_gain{FirstGain::consistent};
  double noise_um{1.0};             ///< standard deviation of a probing
  double turn_um{3.0};              ///< two_phase: return from the extreme that begins phase 2
  double contribution_um_min{3.0};  ///< a smaller one does not determine its gain
  double gain_min{0.3};
  double gain_max{3.0};
  double step_um_max{10.0};  ///< largest change of the estimate by one probing
  double gain_sd{0.3};       ///< recursive: standard deviation of a gain before any probing
  double gain_drift_per_sqrt_h{0.1};
  double bias_drift_um_per_sqrt_h{0.0};  ///< 0: no bias is learned
  double outlier_sigma{4.0};
  double probe_sd_um{3.0};  ///< limit above which a new probing is requested

  static constexpr auto numbers() {
    using Key = NumberKey<CorrectionConfig>;
    using C = CorrectionConfig;
    return std::array{
        Key{"noise_um", &C::noise_um, 0.01, 100},
        Key{"turn_um", &C::turn_um, 0.01, 500},
        Key{"contribution_um_min", &C::contribution_um_min, 0.01, 500},
        Key{"gain_min", &C::gain_min, 0, 1},
        Key{"gain_max", &C::gain_max, 1, 10},
        Key{"step_um_max", &C::step_um_max, 0.01, 500},
        Key{"gain_sd", &C::gain_sd, 0.001, 10},
        Key{"gain_drift_per_sqrt_h", &C::gain_drift_per_sqrt_h, 0, 10},
        Key{"bias_drift_um_per_sqrt_h", &C::bias_drift_um_per_sqrt_h, 0, 100},
        Key{"outlier_sigma", &C::outlier_sigma, 1, 100},
        Key{"probe_sd_um", &C::probe_sd_um, 0.01, 500},
    };
  }
  void validate() const { require_numbers(*this); }  ///< @throws InvalidValue
  /// It gives an offset even where the model gives no displacement.
  [[nodiscard]] bool learns_bias() const noexcept {
    return form == CorrectionForm::constant ||
           (form == CorrectionForm::recursive && bias_drift_um_per_sqrt_h > 0.0);
  }
  bool operator==(const CorrectionConfig&) const = default;
};

/// Limits of the screening of readings.
struct ScreeningConfig {
  double temp_degC_min{-30.0};
  double temp_degC_max{200.0};
  double stale_after_s{5.0};
  double rate_K_per_s_max{0.5};  ///< fastest accepted slew
  double rate_allowance_K{1.0};  ///< allowance for noise in a step [K]
  double outage_K_max{10.0};     ///< largest change over an outage, plus 10 K/h
  double settle_s{10.0};         ///< time that a value must last before it counts; 0: at once
  double stuck_after_s{0.0};     ///< a value unchanged for longer is a fault; 0: never
  double raw_0_degC{0.0};        ///< what a device's raw 0 means; no key, from the channel

  static constexpr auto numbers() {
    using Key = NumberKey<ScreeningConfig>;
    using C = ScreeningConfig;
    return std::array{
        Key{"temp_degC_min", &C::temp_degC_min, -273.15, 2000},
        Key{"temp_degC_max", &C::temp_degC_max, -273.15, 2000},
        Key::above("stale_after_s", &C::stale_after_s, 0, 3600),
        Key::above("rate_K_per_s_max", &C::rate_K_per_s_max, 0, 1e6),
        Key{"rate_allowance_K", &C::rate_allowance_K, 0, 1000},
        Key{"outage_K_max", &C::outage_K_max, 0, 1000},
        Key{"settle_s", &C::settle_s, 0, 3600},
        Key{"stuck_after_s", &C::stuck_after_s, 0, 1e6},
    };
  }
  void validate() const;  ///< @throws InvalidValue
};

enum class SmoothingForm { off, sliding_line, line_of_lines };
enum class SmoothingHistory { raw, screened };

inline constexpr std::size_t smoothing_blocks_max = 6;

/// JPH0736976B2: sliding_line is claim 1 (form A), line_of_lines is claim 2 (form B).
struct SmoothingConfig {
  SmoothingForm form{SmoothingForm::sliding_line};
  SmoothingHistory history{SmoothingHistory::screened};
  double period_s{60.0};     ///< one value of the sensor per period; 0: every reading
  std::uint64_t samples{6};  ///< n, values in a line
  std::uint64_t blocks{3};   ///< line_of_lines: number of lines extrapolated from
  double half_width_K{0.3};  ///< w, half the band
  double outage_s{5.0};      ///< a gap longer than this and than two periods restarts the history

  static constexpr auto numbers() {
    using Key = NumberKey<SmoothingConfig>;
    using C = SmoothingConfig;
    return std::array{
        Key{"period_s", &C::period_s, 0, 3600},
        Key::whole("samples", &C::samples, 3, 32),
        Key::whole("blocks", &C::blocks, 1, smoothing_blocks_max),
        Key::above("half_width_K", &C::half_width_K, 0, 100),
        Key::above("outage_s", &C::outage_s, 0, 86400),
    };
  }
  void validate() const { require_numbers(*this); }  ///< @throws InvalidValue
};

struct SensorConfig {
  std::string name;
  std::string module{};  ///< the device that reads it; "": a device of its own
  std::optional<std::size_t> reference_sensor;  ///< the value is the difference to this sensor
  ScreeningConfig screening;
  SmoothingConfig smoothing;
};

/// A part of the structure with one temperature, the mean of its sensors.
struct BlockConfig {
  std::string name;
  std::string input;                 ///< temperature column of the model
  std::vector<std::size_t> sensors;  ///< indices, at least one
};

/// Largest bound that any axis may be given.
inline constexpr double offset_um_max_of_any_axis = 500.0;

struct LimiterConfig {
  double offset_um_max{50.0};
  double rate_um_per_s_max{1.0};
  double step_s_max{1.0};  ///< time that one step uses at most, so that an overrun causes no jump

  static constexpr auto numbers() {
    using Key = NumberKey<LimiterConfig>;
    using C = LimiterConfig;
    return std::array{
        Key::above("offset_um_max", &C::offset_um_max, 0, offset_um_max_of_any_axis),
        Key::above("rate_um_per_s_max", &C::rate_um_per_s_max, 0, 1000),
    };
  }
  void validate() const { require_numbers(*this); }  ///< @throws InvalidValue
};

/// How the controller interpolates the offsets along an axis' travel.
enum class TravelForm : std::uint8_t {
  line,  ///< straight line between two nodes, the ends, fitted to the curve
  table  ///< linear from node to node
};

/// A position of an axis' travel with an offset of its own. The controller interpolates between the
/// nodes by its own position, so bound and slew limit of the nodes hold everywhere between them.
struct TravelNode {
  std::string axis;  ///< axis of the travel, "x"; its nodes are adjacent and in order of position
  std::string position;  ///< position signal of the model, "x_mm"
  double position_mm{0.0};
  TravelForm form{TravelForm::table};
};

/// An axis with an offset (for a rotary axis, um reads urad), or one node of its travel.
struct AxisConfig {
  std::string name;    ///< "z"
  std::string output;  ///< output of the model whose negative is sent
  double sign{1.0};    ///< -1 where the controller counts the offset with the opposite sign
  LimiterConfig limiter;
  std::optional<TravelNode> node{};
};

enum class LossPolicy { hold, ramp_to_zero };
enum class StopPolicy { hold, ramp_to_zero };

/// The offset while the machine is outside the model's domain.
enum class OutsidePolicy {
  warn,  ///< follows the model; reported in status and history
  hold,
  shrink  ///< follows a share of the displacement, see ModelDomain::used_share()
};

/// Treatment of a sensor whose good values its neighbours contradict.
enum class SuspectedPolicy {
  off,
  warn,       ///< it is used; reported in status and history
  weigh_down  ///< excluded from its blocks while the estimate without it is certain enough
};

enum class UpdateRule {
  continuous,  ///< the offset follows the model
  each_cycle   ///< the offset changes at the end of a machining cycle
};

struct CompensationConfig {
  UpdateRule update{UpdateRule::continuous};
  std::string cycle_end_signal;        ///< "cycle_end_on", "cycles"; empty: by command only
  std::uint64_t cycles_per_update{1};  ///< each_cycle: an update at every n-th cycle end
  double cycle_ahead{0.0};  ///< each_cycle: extrapolation by this share of the last change
  LossPolicy on_loss{LossPolicy::hold};
  double hold_s{600.0};                  ///< ramp_to_zero: hold this long first
  StopPolicy on_stop{StopPolicy::hold};  ///< offsets when the daemon is stopped
  double stop_ramp_s_max{120.0};         ///< ramp_to_zero: longest duration
  /// Initial state without a saved one; false: nothing moves before an operator enables it.
  bool enabled_at_first_start{false};
  bool hold_while_cutting{false};  ///< the offset changes only while cutting_signal is 0
  std::string cutting_signal;      ///< "cutting_on"; empty: none
  std::string disable_signal;      ///< "compensation_off_on": 1 disables; empty: none
  double controller_stale_after_s{2.0};
  double mismatch_um{2.0};       ///< tolerated difference between applied and sent
  double mismatch_after_s{3.0};  ///< longest duration of a larger one
  /// Without read-back and readable registers: largest distance of the first offset after a power
  /// cut from the one sent last [um], hence of the offset from the saved one.
  double restart_leap_um_max{1.0};
  /// Estimates a block without a good sensor where the model has a covariance.
  bool estimate_lost_blocks{true};
  double offset_sd_um_max{5.0};  ///< of any axis; an estimate beyond it is not used: hold
  OutsidePolicy outside_domain{OutsidePolicy::warn};  ///< for a model with [made_from]
  /// For a model with a covariance.
  SuspectedPolicy suspected_sensors{SuspectedPolicy::warn};
  double warm_um{5.0};  ///< largest motion still to come of an axis of a warm machine
  double prove_um_max{10.0};
  double prove_hold_s{3.0};

  static constexpr auto numbers() {
    using Key = NumberKey<CompensationConfig>;
    using C = CompensationConfig;
    return std::array{
        Key::whole("cycles_per_update", &C::cycles_per_update, 1, 1'000'000),
        Key{"cycle_ahead", &C::cycle_ahead, 0, 1},
        Key{"hold_s", &C::hold_s, 0, 1e6},
        Key::above("stop_ramp_s_max", &C::stop_ramp_s_max, 0, 3600),
        Key::above("controller_stale_after_s", &C::controller_stale_after_s, 0, 3600),
        Key::above("mismatch_um", &C::mismatch_um, 0, 500),
        Key::above("mismatch_after_s", &C::mismatch_after_s, 0, 3600),
        Key::above("restart_leap_um_max", &C::restart_leap_um_max, 0, 500),
        Key::above("offset_sd_um_max", &C::offset_sd_um_max, 0, 500),
        Key::above("warm_um", &C::warm_um, 0, 500),
        Key::above("prove_um_max", &C::prove_um_max, 0, 50),
        Key{"prove_hold_s", &C::prove_hold_s, 0, 60},
    };
  }
  void validate() const;  ///< @throws InvalidValue
};

struct EstimatorConfig {
  std::vector<SensorConfig> sensors;
  std::vector<BlockConfig> blocks;
  std::vector<std::string> signals;  ///< reported by the controller, order of ControllerState
  std::vector<AxisConfig> axes;
  bool controller_reads_back{true};  ///< the controller reports applied_um
  CompensationConfig compensation;
  CorrectionConfig correction;
};

struct AxisSpan {
  std::size_t first{0};
  std::size_t count{1};

  [[nodiscard]] std::size_t end() const noexcept { return first + count; }
  bool operator==(const AxisSpan&) const = default;
};

/// Name in commands and reports: a node has that of its axis.
[[nodiscard]] inline const std::string& axis_name(const AxisConfig& axis) noexcept {
  return axis.node ? axis.node->axis : axis.name;
}

[[nodiscard]] inline std::vector<std::string> entry_names(const std::vector<AxisConfig>& axes) {
  std::vector<std::string> names;
  names.reserve(axes.size());
  for (const AxisConfig& axis : axes) names.push_back(axis.name);
  return names;
}

/// In the order of the axes; the spans cover all entries.
[[nodiscard]] inline std::vector<AxisSpan> axis_spans(const std::vector<AxisConfig>& axes) {
  std::vector<AxisSpan> spans;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const bool goes_on =
        i > 0 && axes[i].node && axes[i - 1].node && axes[i].node->axis == axes[i - 1].node->axis;
    if (goes_on)
      ++spans.back().count;
    else
      spans.push_back({i, 1});
  }
  return spans;
}

/// Span that contains the entry. @pre entry < axes.size()
[[nodiscard]] inline AxisSpan span_of(const std::vector<AxisConfig>& axes, std::size_t entry) {
  for (const AxisSpan& span : axis_spans(axes))
    if (entry < span.end()) return span;
  return {entry, 1};
}

/// Offset at a position, as a controller interpolates it from the nodes of a travel: linear between
/// two nodes, constant beyond the ends. No allocation.
/// @param nodes  entries of one span, each with a node
[[nodiscard]] inline double value_on_travel(std::span<const AxisConfig> nodes,
                                            std::span<const double> values,
                                            double position_mm) noexcept {
  std::size_t above = 1;
  while (above + 1 < nodes.size() && position_mm > nodes[above].node->position_mm) ++above;
  if (above >= nodes.size()) return values[0];
  const double low_mm = nodes[above - 1].node->position_mm;
  const double high_mm = nodes[above].node->position_mm;
  const double share = std::clamp((position_mm - low_mm) / (high_mm - low_mm), 0.0, 1.0);
  return (1.0 - share) * values[above - 1] + share * values[above];
}

}  // namespace thermocomp
