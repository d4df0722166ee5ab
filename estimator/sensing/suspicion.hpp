/// Detection of sensors whose values are good but contradict their neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/sensing/neighbours.hpp"
#include "estimator/sensing/sensor.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Each minute (a tick, the median of five screened, unsmoothed samples) the NeighbourCheck judges
/// four changes of all inputs:
///
///     jump   the step between two lines of five ticks each, extrapolated to where they meet
///     creep  the level (median of five ticks) less that of 1, 4 and 12 hours ago; for half an hour
///
/// Only changes count: neither the mean of the record nor the reference is needed, and a constant
/// error does no harm. In a block of several sensors, the suspect is the one without which the
/// block agrees with its neighbours.
///
/// The error of a suspected sensor is re-estimated every tick, from the part of its change that the
/// others do not share. The suspicion ends when little of the error is left for ten ticks, when the
/// sensor is faulted for ten ticks (being repaired), or with a new reference. Its history is then
/// cleared.
class Suspicion {
 public:
  /// @pre inputs of the model with a covariance, NeighbourCheck::inputs_min at least
  /// @throws InvalidValue when covariance and model do not fit each other; allocates
  Suspicion(const EstimatorConfig& config, const ThermalModel& model);

  /// True if step() needs values at `now`.
  [[nodiscard]] bool is_due(nanoseconds now) const noexcept {
    return !state_.started || now >= state_.next_look;
  }
  /// @param values_K  one per sensor, screened; NaN: not usable
  /// Never throws, never allocates. O(inputs^2) once a minute, else O(sensors).
  void step(nanoseconds now, std::span<const double> values_K) noexcept;

  [[nodiscard]] std::size_t count() const noexcept { return state_.count; }
  /// One per sensor: 1 excludes it from its blocks.
  [[nodiscard]] std::span<const std::uint8_t> weighed_down() const noexcept {
    return state_.weighed_down;
  }
  /// An input without the errors of its sensors.
  struct Corrected {
    std::size_t input{0};
    double temp_degC{not_a_number};
    double sd_K{0.0};
  };
  /// Inputs whose sensors the last step began to exclude.
  [[nodiscard]] std::span<const Corrected> newly_weighed_down() const noexcept {
    return {corrected_.data(), corrected_count_};
  }
  /// Uses suspected sensors, because the offsets would be too uncertain without them.
  void use_all() noexcept;
  /// Clears the sensor's history, which no longer applies to its readings.
  void clear_history(std::size_t sensor) noexcept {
    state_.suspected[sensor] != 0 ? end(sensor) : forget(sensor);
  }
  /// A new reference: machine and sensors are right as they are now.
  void restart() noexcept;

  void report(std::span<SensorReport> sensors) const noexcept;
  void plan_adoption(const Suspicion& previous);
  void adopt(const Suspicion& previous) noexcept;
  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  static constexpr std::size_t looks = 5;       ///< samples in a tick
  static constexpr std::size_t line_ticks = 5;  ///< in each line, and in a level
  static constexpr std::size_t ticks_kept = 2 * line_ticks;
  static constexpr std::size_t ticks_a_level = 15;  ///< between two kept levels
  static constexpr std::size_t levels_kept = 49;    ///< 12 h

  struct State {
    bool started{false};
    nanoseconds next_look{};
    nanoseconds last_look{};
    nanoseconds tick_begin{};
    std::size_t looked{0};  ///< samples in the present tick
    std::size_t ticks_since_level{0};
    std::size_t next_tick{0};
    std::size_t next_level{0};
    std::size_t count{0};                    ///< suspected sensors
    std::vector<double> looked_K;            ///< shape (sensors, looks)
    std::vector<double> ticks_K;             ///< shape (sensors, ticks_kept), a ring
    std::vector<double> levels_K;            ///< shape (sensors, levels_kept), a ring
    std::vector<std::uint8_t> suspected;     ///< one per sensor, as all below
    std::vector<std::uint8_t> weighed_down;  ///< ... and excluded
    std::vector<double> size_K;              ///< present error
    std::vector<double> found_K;             ///< error when it was found
    std::vector<nanoseconds> since;
    std::vector<std::uint32_t> agreed_ticks;   ///< in a row
    std::vector<std::uint32_t> missing_ticks;  ///< in a row
    std::vector<std::uint32_t> creep_ticks;    ///< consecutive ticks of apparent creep
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t);
    }
  };

  [[nodiscard]] double& tick(std::size_t sensor, std::size_t back) noexcept;
  [[nodiscard]] double level_K(std::size_t sensor, std::size_t back) noexcept;
  [[nodiscard]] double jump_K(std::size_t sensor) noexcept;
  void close_tick(nanoseconds now) noexcept;
  void keep_levels() noexcept;
  void follow_suspected() noexcept;
  void follow(std::size_t sensor) noexcept;
  void look_for_jumps(nanoseconds now) noexcept;
  void look_for_creep(nanoseconds now, std::size_t levels_back) noexcept;
  /// Changes of the inputs from changes_K_: mean over the sensors that are not suspected.
  void join_changes() noexcept;
  struct Suspect {
    bool found{false};
    std::size_t sensor{0};
    std::size_t input{0};
    double size_K{0.0};
    double sd_K{0.0};
  };
  [[nodiscard]] Suspect suspect_of(const NeighbourCheck::Wrong& wrong) const noexcept;
  [[nodiscard]] double lasting_change_K(const Suspect& suspect,
                                        const NeighbourCheck::Answer& answer) noexcept;
  void begin(const Suspect& suspect, nanoseconds since) noexcept;
  void end(std::size_t sensor) noexcept;
  void forget(std::size_t sensor) noexcept;
  /// The first input of the sensor; the number of inputs: none.
  [[nodiscard]] std::size_t input_of(std::size_t sensor) const noexcept;
  [[nodiscard]] std::size_t unsuspected_sensors(std::size_t input) const noexcept;
  void correct(std::size_t sensor, double sd_K) noexcept;

  const std::vector<std::string> names_;       ///< of the sensors
  const std::vector<std::string> references_;  ///< ... reference sensors of theirs, or ""
  const bool may_weigh_down_;
  const std::vector<std::vector<std::size_t>> inputs_;  ///< sensors of each
  NeighbourCheck check_;

  State state_;

  std::vector<double> changes_K_;        ///< scratch, one per sensor
  std::vector<double> input_changes_K_;  ///< scratch, one per input
  std::vector<double> errors_K_;         ///< scratch, one per input
  std::vector<double> misfit_K_;         ///< scratch, one per sensor: rms about its lines
  std::vector<std::uint8_t> creeps_;     ///< scratch, one per sensor
  std::vector<Corrected> corrected_;
  std::size_t corrected_count_{0};
  std::vector<int> sensor_plan_;  ///< index in the previous one, -1: none or another quantity
};

}  // namespace thermocomp
