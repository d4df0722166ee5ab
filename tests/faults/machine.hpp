/// The true state of a small machine: temperatures, their measuring units, the controller. A
/// function of time and seed, with a record of the values given out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/modbus/modbus_config.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"
#include "fault_schedule.hpp"

namespace thermocomp::faults {

inline constexpr std::size_t sensors_count = 7;
inline constexpr std::size_t buses_count = 2;
inline constexpr std::size_t units_count = 4;
inline constexpr std::size_t axes_count = 3;

/// True if the model of this life learns from probings. Every other life does not, so that rare
/// bugs do not become rarer.
[[nodiscard]] constexpr bool corrects_itself(std::uint64_t seed) noexcept {
  return seed % 2 == 1;
}

/// True if the model of this life has a covariance, so that sensors are checked against their
/// neighbours; one sensor then has a plausible error during one of every two hours.
[[nodiscard]] constexpr bool judges_sensors(std::uint64_t seed) noexcept {
  return seed % 3 == 1;
}

/// True if the controller of this life interpolates: the second and third axis are two nodes of one
/// travel, with their offsets in one register set. Excludes corrects_itself().
[[nodiscard]] constexpr bool interpolates(std::uint64_t seed) noexcept {
  return seed % 8 == 2;
}

/// True if the controller of this life may take seconds to answer, with a matching timeout.
[[nodiscard]] constexpr bool waits_long(std::uint64_t seed) noexcept {
  return seed % 8 == 5;
}

/// True if the controller of this life has read-back. Without it, its applied offset changes by
/// itself only at a restart.
[[nodiscard]] constexpr bool reads_back(std::uint64_t seed) noexcept {
  return seed % 8 != 6 && seed % 32 != 10;
}
/// True if the written registers can be read; required for a set.
[[nodiscard]] constexpr bool shows_registers(std::uint64_t seed) noexcept {
  return seed % 16 != 6;
}

/// Configuration of a life, drawn from its seed.
struct MachineShape {
  MachineShape(std::uint64_t seed, double cycle_hz);

  std::array<ModbusBusConfig, buses_count> buses;
  ModbusControllerConfig controller;
  EstimatorConfig estimator;
  ThermalModel model;
  bool offsets_are_float{false};

  /// Changes that an operator might make by a reload: bounds, slew, matrix, policy.
  void change_for_reload(Chance& chance);
  /// The active model with another matrix.
  [[nodiscard]] ThermalModel offered_model(Chance& chance) const;
};

/// Register layout of a simulated unit; equal to MachineShape but defined separately, so that the
/// drivers' decoding is checked against an independent encoder.
struct UnitPlace {
  std::size_t bus{0};
  int unit{1};
  std::vector<std::size_t> sensors;
  bool floats{false};  ///< else int16 of 0.01 K
  bool words_low_first{false};
  bool has_counter{false};
  bool has_status{false};
};
[[nodiscard]] const std::array<UnitPlace, units_count>& unit_places();
[[nodiscard]] std::size_t unit_of(std::size_t sensor);

/// A sensor value given out by a unit.
struct Sample {
  nanoseconds given_at{-1};
  nanoseconds converted_at{-1};
  double temp_degC{0.0};
  bool good{false};        ///< not marked as faulty by the unit
  bool impossible{false};  ///< a spike no structure can follow
};

class Thermocouples {
 public:
  Thermocouples(std::uint64_t seed, const FaultSchedule& schedule);

  /// Registers from `address` on at `time`; records the values given out.
  void read(std::size_t place, std::size_t address, std::span<std::uint16_t> words,
            nanoseconds time);
  /// No spikes until then: a daemon cannot recognise a spike in its first value.
  void no_spikes_before(nanoseconds time) noexcept { spikes_from_ = time; }
  /// Temperature at the sensor's place plus creeping errors, without the faults that an inspection
  /// of the machine shows at once.
  [[nodiscard]] double plausible_degC(std::size_t sensor, nanoseconds time) const noexcept;
  /// A good sample of the sensor with this value given out in [from, to]; nullptr: none.
  [[nodiscard]] const Sample* given(std::size_t sensor, double temp_degC, nanoseconds from,
                                    nanoseconds to) const noexcept;
  /// Conversion time of the sensor's newest good value; -1: none.
  [[nodiscard]] nanoseconds last_good(std::size_t sensor) const noexcept {
    return last_good_[sensor];
  }

 private:
  static constexpr std::size_t kept = 64;
  [[nodiscard]] double true_degC(std::size_t sensor, nanoseconds time) const noexcept;
  [[nodiscard]] double error_K(std::size_t sensor, nanoseconds time) const noexcept;
  [[nodiscard]] double creep_K(std::size_t sensor, nanoseconds at) const noexcept;
  [[nodiscard]] double through_unit(std::size_t sensor, double temp_degC,
                                    nanoseconds time) const noexcept;
  [[nodiscard]] Sample convert(std::size_t sensor, nanoseconds time) const noexcept;
  /// Neither open nor shorted.
  [[nodiscard]] bool whole(std::size_t sensor, nanoseconds time) const noexcept;
  void put(const UnitPlace& place, std::span<std::uint16_t> value, const Sample& sample) const;
  void record(std::size_t sensor, const Sample& sample) noexcept;

  std::uint64_t seed_;
  const FaultSchedule& schedule_;
  struct Course {
    double mean_degC;
    double swing_K;
    double rate_per_s;
    double phase;
  };
  nanoseconds spikes_from_{};
  std::array<Course, sensors_count> courses_{};
  std::array<std::array<Sample, kept>, sensors_count> samples_{};
  std::array<std::size_t, sensors_count> given_{};
  std::array<nanoseconds, sensors_count> last_good_{};
};

/// Controller registers; a write that reaches it becomes one `Move` per axis.
struct Move {
  std::size_t axis{0};
  nanoseconds at{};
  double from_um{0.0};  ///< applied before
  double to_um{0.0};    ///< written
  /// The controller has changed this offset by itself since the last accepted write.
  bool disturbed{false};
  bool seen{false};         ///< ... and reported it in a read-back since
  std::uint64_t breaks{0};  ///< of the link, until then
  nanoseconds looked_at{};  ///< time of the last read-back
  nanoseconds seen_at{};    ///< time of the first read-back that showed the change
};

class SimulatedController {
 public:
  SimulatedController(std::uint64_t seed, const FaultSchedule& schedule, bool floats);

  /// Registers at `time`. @return false: refused
  bool read(std::size_t address, std::span<std::uint16_t> words, nanoseconds time);
  /// A new daemon, without knowledge of earlier restarts.
  void daemon_starts() noexcept { is_in_contact_ = restart_is_noticed_ = false; }
  /// An operator sets the offset to zero.
  void set_to_zero(std::size_t axis);
  /// @return false: refused
  bool write(std::size_t address, std::span<const std::uint16_t> words, nanoseconds time);

  [[nodiscard]] bool powered(nanoseconds time) const noexcept;
  /// True if the written, applied and read-back offsets may differ.
  [[nodiscard]] bool has_wrong_read_back(nanoseconds time) const noexcept;
  /// A line error or new connection: the device may now be another controller, or a restarted one.
  void link_broke() noexcept {
    ++breaks_;
    reads_since_break_ = 0;
  }
  [[nodiscard]] std::uint64_t link_breaks() const noexcept { return breaks_; }
  /// The signal as shown: wrong for two seconds at times if the model learns from probings.
  [[nodiscard]] bool reports_cutting(nanoseconds time) const noexcept;
  [[nodiscard]] bool switched_off(nanoseconds time) const noexcept;
  [[nodiscard]] double applied_um(std::size_t axis) const noexcept { return applied_um_[axis]; }
  /// Time of the newest accepted command.
  [[nodiscard]] nanoseconds written_at() const noexcept { return written_at_; }
  /// Moves since the last call.
  [[nodiscard]] std::vector<Move>& moves() noexcept { return moves_; }
  void advance(nanoseconds time);

 private:
  void disturb(std::size_t axis, double applied_um);
  void restart();
  [[nodiscard]] const FaultEvent* read_back_fault(FaultKind kind, std::size_t axis,
                                                  nanoseconds time) const;
  [[nodiscard]] double shown_um(std::size_t axis, nanoseconds time);
  [[nodiscard]] std::size_t words_an_offset() const noexcept { return floats_ ? 2 : 1; }
  /// Index in the written registers (from 200) of an axis's offset, and of the valid bits.
  [[nodiscard]] std::size_t offset_at(std::size_t axis) const noexcept {
    return words_an_offset() * axis + (interpolates(seed_) && axis > 0 ? 1 : 0);
  }
  [[nodiscard]] std::size_t valid_at() const noexcept {
    return words_an_offset() * axes_count + (interpolates(seed_) ? 2 : 0);
  }
  [[nodiscard]] bool is_ordered(std::size_t axis) const noexcept;

  std::uint64_t seed_;
  const FaultSchedule& schedule_;
  bool floats_;
  bool on_{true};
  std::uint64_t last_rehoming_{0};
  std::uint64_t breaks_{0};
  std::uint64_t reads_since_break_{0};
  bool is_in_contact_{false};  ///< with this daemon
  bool restart_is_noticed_{false};
  nanoseconds looked_at_{};
  nanoseconds written_at_{};
  std::array<std::uint64_t, axes_count> frozen_by_{};  ///< the fault that froze the read-back
  std::array<double, axes_count> frozen_um_{};
  std::array<double, axes_count> applied_um_{};
  std::array<bool, axes_count> disturbed_{};
  std::array<bool, axes_count> seen_{};
  std::array<nanoseconds, axes_count> seen_at_{};
  std::array<std::uint16_t, 16> written_{};
  std::vector<Move> moves_;
};

}  // namespace thermocomp::faults
