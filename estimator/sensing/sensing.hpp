/// Temperatures of the model's columns from readings.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/sensing/neighbours.hpp"
#include "estimator/sensing/sensor.hpp"
#include "estimator/sensing/suspicion.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Time of what has not happened.
inline constexpr nanoseconds never = nanoseconds::min();

/// Block temperatures from sensors: screening, smoothing, differences, mean of a block's sensors.
/// All sensors and their blocks, in the order of the model's temperature columns.
class BlockBank {
 public:
  /// @throws InvalidValue when a column has no block or a block no sensor
  BlockBank(const EstimatorConfig& config, const std::vector<std::string>& columns);

  void read(nanoseconds now, std::span<const Reading> readings) noexcept;
  /// Number of sensors with an unconfirmed value.
  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_; }
  /// Number of these after a jump.
  [[nodiscard]] std::size_t jumped() const noexcept { return jumped_; }
  /// Before read(), while values wait: the expectation from the other blocks.
  /// @param expected_degC, sd_K  of a column; NaN: no expectation
  void expect(std::span<const double> expected_degC, std::span<const double> sd_K) noexcept;
  /// Before the first step: the sensor's value before an unconfirmed jump of the previous run.
  void restore_jump(const std::string& name, double from_degC);
  /// Confirms the sensor's newest value. @return true if one was waiting
  bool accept(std::size_t sensor) noexcept;
  /// Shape (columns): start of the last confirmed jump of a sensor, which refutes the values before
  /// it; `never`: none.
  [[nodiscard]] std::span<const nanoseconds> refuted_at() const noexcept { return refuted_at_; }
  /// Screened values before smoothing; one per sensor, NaN: none.
  void screened(nanoseconds now, std::span<double> values_K) const noexcept;
  /// @param left_out  one per sensor: 1 excludes it; empty: all are used
  /// @return true if every column has a usable temperature
  bool join(std::span<const std::uint8_t> left_out) noexcept;
  /// Call when a sensor of the block is excluded: the block continues from `temp_degC`, the
  /// reference for the deviations of its other sensors.
  void continue_from(std::size_t column, double temp_degC) noexcept;

  /// Shape (columns): block temperatures; the last known one where not good, NaN before the first.
  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return temps_degC_; }
  [[nodiscard]] bool good(std::size_t column) const noexcept { return good_[column] != 0; }
  [[nodiscard]] std::span<const std::uint8_t> good() const noexcept { return good_; }

  void report(std::span<SensorReport> sensors) const noexcept;
  void visit_state(StateArchive& archive);

  void plan_adoption(const BlockBank& previous);
  void adopt(const BlockBank& previous) noexcept;

 private:
  struct Sensor {
    Sensor(const SensorConfig& sensor_config);
    Screening screening;
    Smoother smoother;
    int reference;  ///< index of the reference sensor, or no_sensor
    std::size_t module{0};
    double raw_degC{not_a_number};
    Fault fault{Fault::never_read};
    bool fresh{false};    ///< the newest reading is new and good
    SensorConfig config;  ///< last: not used in a step
    void visit_state(StateArchive& archive) {
      archive(screening, smoother, raw_degC, fault, fresh);
    }
  };
  struct Block {
    std::vector<std::size_t> sensors;
    /// Deviation of each sensor from the block's mean while all were good, so that the loss of a
    /// sensor does not shift the mean.
    std::vector<double> deviation_K;
  };

  void look_at(Sensor& sensor, nanoseconds now, const Reading& reading) noexcept;
  void note_refuted(const Sensor& sensor) noexcept;
  [[nodiscard]] bool is_not_ready(const std::vector<std::size_t>& module) const noexcept;
  [[nodiscard]] bool has_other_witness(std::size_t module) const noexcept;
  /// @return the sensor's value for its block; NaN: not usable
  [[nodiscard]] double smooth(Sensor& sensor, nanoseconds now) noexcept;
  /// Index of the reference sensor in the previous bank, or no_sensor.
  [[nodiscard]] int previous_reference(const Sensor& sensor) const noexcept;
  [[nodiscard]] bool update(Block& block, double& temp_degC) noexcept;
  /// Sets the mean of the remaining sensors, less their deviations. @return false if none remains
  [[nodiscard]] bool update_without_the_missing(const Block& block,
                                                double& temp_degC) const noexcept;

  std::vector<Sensor> sensors_;
  std::vector<std::vector<std::size_t>> modules_;  ///< sensors of each module
  std::size_t waiting_{0};
  std::size_t jumped_{0};
  std::vector<std::size_t> witnesses_;   ///< scratch, one per module: its sensors in good columns
  std::vector<nanoseconds> refuted_at_;  ///< one per column
  std::vector<double> values_K_;         ///< of this step, one per sensor; NaN: not usable
  std::vector<double> kept_K_;           ///< scratch: the same, NaN where excluded
  std::span<const double> in_use_K_;     ///< one of the two, during join()
  std::vector<Block> blocks_;            ///< one per column
  std::vector<double> temps_degC_;
  std::vector<std::uint8_t> good_;
  nanoseconds now_{};
  std::vector<int> sensor_plan_;  ///< index of the previous bank's sensor, -1: none
  std::vector<int> block_plan_;
};

/// Temperatures of the model's columns; all spans have that shape and are valid until the next
/// step.
struct Temperatures {
  std::span<const double> measured_degC;    ///< the last known value where not good
  std::span<const std::uint8_t> good;       ///< measured in this step
  std::span<const nanoseconds> refuted_at;  ///< start of the last confirmed jump, or `never`
  std::span<const double> estimated_degC;   ///< measured, or estimated where lost
  bool all_good{false};
  bool complete{false};  ///< each is measured or estimated
  bool jumped{false};    ///< an unconfirmed value contradicts the earlier ones
  bool suspected{false};
  bool weighed_down{false};  ///< a suspected sensor is excluded from its blocks
};

/// Screening and smoothing per sensor, blocks, and estimates of blocks without a good sensor.
class Sensing {
 public:
  /// @throws InvalidValue when a column has no block or a block no sensor
  Sensing(const EstimatorConfig& config, const ThermalModel& model);

  /// @param readings  one per sensor, order of the configuration (checked)
  [[nodiscard]] Temperatures step(nanoseconds now, std::span<const Reading> readings) noexcept;

  /// Includes the excluded sensors again, since their estimates are too uncertain.
  /// @return the temperatures of this step, computed again
  [[nodiscard]] Temperatures use_all(nanoseconds now) noexcept;
  void accept(std::size_t sensor) noexcept;
  /// A new reference: the present readings are taken as right, and suspicions end.
  void end_suspicions() noexcept;

  void report(std::span<SensorReport> sensors) const noexcept;
  [[nodiscard]] const BlockBank& blocks() const noexcept { return blocks_; }
  [[nodiscard]] const LostBlocks& lost() const noexcept { return lost_; }
  [[nodiscard]] bool all_good() const noexcept;

  /// Before the first step: temperatures at the end of the previous run, by column, and the values
  /// of sensors before an unconfirmed jump.
  void restore(const std::map<std::string, double>& temps_degC,
               const std::map<std::string, double>& jumped_from_degC);
  void plan_adoption(const Sensing& previous);
  void adopt(const Sensing& previous) noexcept;
  void visit_state(StateArchive& archive) {
    archive(blocks_, lost_);
    if (suspicion_) archive(*suspicion_);
  }

 private:
  void weigh_waiting() noexcept;
  [[nodiscard]] std::span<const std::uint8_t> suspect(nanoseconds now) noexcept;
  [[nodiscard]] Temperatures join(nanoseconds now, std::span<const std::uint8_t> left_out) noexcept;

  const std::vector<std::string> columns_;
  BlockBank blocks_;
  LostBlocks lost_;
  std::optional<Suspicion> suspicion_;
  std::vector<double> screened_K_;     ///< scratch, one per sensor
  std::vector<double> expected_degC_;  ///< scratch, one per column
  std::vector<double> expected_sd_K_;  ///< scratch, one per column
};

}  // namespace thermocomp
