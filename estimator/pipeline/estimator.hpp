/// From readings to offsets, one cycle at a time: the part of the daemon that replay, the fault
/// simulation and the tools run too; and what of it survives a restart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/report.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What survives a restart by name (the state file).
struct PersistentState {
  bool enabled{true};
  std::map<std::string, double> reference_degC;  ///< by temperature column
  /// The numbers that the model file gave as reference at the time, by input; none: first sample.
  /// Other numbers in the file at a restart are deliberate, and replace the stored ones.
  std::map<std::string, double> model_reference_degC;
  std::map<std::string, double> reference_signals;  ///< operating signals then, by column
  std::map<std::string, double> offset_um;          ///< by axis, last sent
  /// By axis, of those whose offset sent stays so near to the one that is saved [um]: what they
  /// start from where nothing better is known.
  std::map<std::string, double> corridor_um;
  std::map<std::string, double> sign;         ///< by axis: what an offset meant
  std::string controller;                     ///< to which the offsets were sent; empty: not known
  std::map<std::string, double> recorded_um;  ///< by axis, of the last-sent record; in no file
  std::map<std::string, double> temp_degC;    ///< in use then, by temperature column
  /// By sensor that had jumped: what it showed before, so that a restart does not confirm the jump.
  std::map<std::string, double> jumped_from_degC;
  std::map<std::string, double> held_degC;     ///< InputReport::held_degC, by column
  std::map<std::string, double> held_signals;  ///< SignalReport::held, by column
  /// RunningCorrection::persistent(), "z.gain1" and so on.
  std::map<std::string, double> correction;
};

/// The numbers that a model file gives as reference, by input.
[[nodiscard]] std::map<std::string, double> reference_numbers(const ThermalModel& model);

/// Whether something differs that must be written at once: switch, references, what was learned
/// and held, and an offset that has gone a quarter of the way that it may go from a saved one.
/// Other offsets and temperatures move all the time; they may wait.
[[nodiscard]] bool must_be_saved(const PersistentState& now, const PersistentState& saved);

/// What lets an estimator know that `saved` is on disk: one command an axis that stays beside it.
[[nodiscard]] std::vector<Command> saved_commands(const EstimatorConfig& config,
                                                  const PersistentState& saved);

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
  [[nodiscard]] PersistentState persistent_state(const Report& report) const;
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
