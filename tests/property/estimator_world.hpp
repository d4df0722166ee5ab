/// Random life of the estimator, reproducible by its seed: all sensor faults, a controller that is
/// re-homed, silent or reports nonsense, operators, reloads, restarts and irregular time.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include "estimator/pipeline/estimator.hpp"

namespace thermocomp::property {

/// The first violation of a rule and its time.
struct Violation {
  std::string_view rule;  ///< name in tests/invariant_list.hpp
  std::string_view what;
  std::size_t step{0};
  double value{0.0};
  double allowed{0.0};
};

/// Bugs planted between world and estimator, to prove that the rules detect them.
enum class Planted {
  nothing,
  double_rate,          ///< the estimator gets twice the slew limit of the rules
  larger_bound,         ///< ... and twice the offset bound
  domain_ignored,       ///< ... and follows outside the model's domain
  faults_hidden,        ///< the estimator gets impossible values as plausible ones
  always_valid,         ///< axes that are not driven are marked valid
  epoch_ignored,        ///< the controller accepts offsets of another epoch
  read_back_hidden,     ///< the estimator's read-back is always what it sent
  reload_from_nothing,  ///< a reload does not adopt the state
  forgotten_state       ///< load_state() does nothing
};

struct WorldOptions {
  std::size_t steps{600};
  Planted planted{Planted::nothing};
  /// The second and third axis are the ends of a travel along "y_mm", or nodes of a table on it.
  bool travel{false};
  /// From this step on all readings are faulty, stale or impossible, or withheld.
  std::optional<std::size_t> lost_from;
  bool lost_are_withheld{false};
  /// Interval in steps of promoting another model and going back; 0: never.
  std::size_t promotion_every{0};
  /// In this step the estimator is replaced by a new one that loads its state.
  std::optional<std::size_t> reload_state_at;
};

struct Outcome {
  std::optional<Violation> violation;
  /// Offsets, targets and valid bits of all steps, as bits.
  std::vector<std::uint64_t> trace;
  double largest_offset_um{0.0};
  std::size_t steps_compensating{0};
  std::size_t steps_estimating{0};
  std::size_t steps_outside{0};  ///< of the model's domain
  std::size_t returns{0};        ///< into it
  std::size_t resyncs{0};
  std::size_t reloads{0};
  std::size_t restarts{0};
};

[[nodiscard]] Outcome live(std::uint64_t seed, const WorldOptions& options);

}  // namespace thermocomp::property
