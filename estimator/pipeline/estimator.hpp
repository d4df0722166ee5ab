/// From readings to offsets, one cycle at a time: the part of the daemon that replay, the fault
/// simulation and the tools run too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/persistent_state.hpp"
#include "estimator/pipeline/report.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Pure: no clock, no I/O, no thread; no allocation after construction except where said.
class Estimator {
 public:
  /// @throws InvalidValue when configuration and model do not fit each other
  Estimator(const EstimatorConfig& config, const ThermalModel& model);
  ~Estimator();
  Estimator(Estimator&&) noexcept;
  Estimator& operator=(Estimator&&) noexcept;

  /// One cycle. `now` must not run backwards. Never throws, never allocates.
  /// @param readings  one per sensor, order of the configuration (checked)
  /// @param command   overwritten: offsets of all axes with the epoch they belong to
  void step(nanoseconds now, std::span<const Reading> readings, const ControllerState& controller,
            OffsetCommand& command) noexcept;
  /// An operator's command, taken between two steps. Never throws, never allocates.
  void apply(const Command& command) noexcept;

  /// Of a `measured` command before apply(), at the moment of which it speaks; NaN: not known.
  struct Probed {
    double displacement_um{not_a_number};  ///< as it would be without any offset
    double model_um{not_a_number};         ///< by the model alone
  };
  [[nodiscard]] Probed probed(const Command& measured) const noexcept;

  /// By bits, one an axis: nothing is known of what was sent last. No allocation.
  [[nodiscard]] std::uint32_t forgotten_axes() const noexcept;

  [[nodiscard]] Report make_report() const;  ///< allocates; sizes are then fixed
  void report(Report& out) const noexcept;   ///< no allocation

  /// The exact inner state as bytes, for a replay from here. Only the same configuration and model
  /// (and build of the program) can load it.
  [[nodiscard]] std::size_t state_size_bytes() const noexcept;
  void save_state(
      std::span<std::byte> out) const noexcept;  ///< @pre out.size() == state_size_bytes()
  void load_state(
      std::span<const std::byte> in);  ///< @throws std::runtime_error on another size or layout

  /// What survives a restart, for restore(); allocates. Only names and `report` are looked at, so
  /// that a cycle may be stepping this estimator.
  /// @param report  of this estimator (sizes are checked)
  [[nodiscard]] PersistentState persistent_state(const Report& report) const {
    return make_persistent_state(config(), model(), report);
  }
  /// Before the first step; allocates. A reference outside what the screening lets the sensors of
  /// its column show was never taken. Then none is restored, and the compensation is switched off,
  /// because the next one would be that of a machine in any state.
  /// @return what was refused, by key, value and rule; empty: nothing
  std::vector<std::string> restore(const PersistentState& state);
  /// Bumpless reload: takes over offsets, switches, references, smoothing and lag states by name.
  /// plan_adoption() allocates and may run on any thread while `previous` is not being replaced;
  /// adopt() neither allocates nor throws.
  void plan_adoption(const Estimator& previous);
  void adopt(const Estimator& previous) noexcept;
  /// After adopt(): the states of the model from one that ran beside. @pre made from the same model
  void adopt_model(const Estimator& beside) noexcept;

  [[nodiscard]] const EstimatorConfig& config() const noexcept;
  [[nodiscard]] const ThermalModel& model() const noexcept;

 private:
  std::unique_ptr<Stages> stages_;
};

}  // namespace thermocomp
