/// The estimator: from readings to offsets, one cycle at a time, as run by daemon, replay, fault
/// simulation and tools.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/report.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct Stages;

/// Pure: no clock, no I/O, no thread; no allocation after construction unless stated.
class Estimator {
 public:
  /// @throws InvalidValue when configuration and model do not fit each other
  Estimator(const EstimatorConfig& config, const ThermalModel& model);
  ~Estimator();
  Estimator(Estimator&&) noexcept;
  Estimator& operator=(Estimator&&) noexcept;

  /// One cycle. `now` must not run backwards. Never throws, never allocates.
  /// @param readings  one per sensor, order of the configuration (checked)
  /// @param command   overwritten: offsets of all axes with their epoch
  void step(nanoseconds now, std::span<const Reading> readings, const ControllerState& controller,
            OffsetCommand& command) noexcept;
  /// An operator's command, taken between two steps. Never throws, never allocates.
  void apply(const Command& command) noexcept;

  /// Displacements at the time of a `measured` command, before apply(); NaN: unknown.
  struct Probed {
    double displacement_um{not_a_number};  ///< without any offset
    double model_um{not_a_number};         ///< by the model alone
  };
  [[nodiscard]] Probed probed(const Command& measured) const noexcept;

  /// One bit per axis: the last sent offset is not known. No allocation.
  [[nodiscard]] std::uint32_t forgotten_axes() const noexcept;

  [[nodiscard]] Report make_report() const;  ///< allocates; later sizes are the same
  void report(Report& out) const noexcept;   ///< no allocation

  /// Exact inner state as bytes, for a replay from here. Only the same configuration, model and
  /// build of the program can load it.
  [[nodiscard]] std::size_t state_size_bytes() const noexcept;
  void save_state(
      std::span<std::byte> out) const noexcept;  ///< @pre out.size() == state_size_bytes()
  void load_state(
      std::span<const std::byte> in);  ///< @throws std::runtime_error on another size or layout

  /// State for restore(); allocates. Uses only names and `report`, so that a cycle may step this
  /// estimator meanwhile.
  /// @param report  of this estimator (sizes are checked)
  [[nodiscard]] PersistentState persistent_state(const Report& report) const;
  /// Before the first step; allocates. A reference outside the screening range of its column was
  /// never measured. Then no reference is restored and the compensation is switched off, because
  /// the next one would be taken in an arbitrary state of the machine.
  /// @return refused references by key, value and rule
  std::vector<std::string> restore(const PersistentState& state);
  /// Bumpless reload: takes over offsets, switches, references, smoothing and lag states by name.
  /// plan_adoption() allocates and may run on any thread while `previous` is not being replaced;
  /// adopt() neither allocates nor throws.
  void plan_adoption(const Estimator& previous);
  void adopt(const Estimator& previous) noexcept;
  /// After adopt(): takes the model states of an estimator run in parallel. @pre made from the same
  /// model
  void adopt_model(const Estimator& beside) noexcept;

  [[nodiscard]] const EstimatorConfig& config() const noexcept;
  [[nodiscard]] const ThermalModel& model() const noexcept;

 private:
  std::unique_ptr<Stages> stages_;
};

}  // namespace thermocomp
