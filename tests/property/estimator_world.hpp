/// A random life of the estimator, the same for the same seed: sensors that fail in every way, a
/// controller that obeys but is re-homed, goes silent and tells nonsense, operators, reloads,
/// restarts and irregular time.
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

/// What went wrong, and when; nothing while all is well.
struct Violation {
  std::string_view rule;  ///< of the list (tests/invariant_list.hpp)
  std::string_view what;
  std::size_t step{0};
  double value{0.0};
  double allowed{0.0};
};

/// Bugs that can be planted on the way between world and estimator, to prove that a rule notices.
enum class Planted {
  nothing,
  double_rate,          ///< the estimator gets twice the slew bound that the rules know
  larger_bound,         ///< ... and twice the offset bound
  domain_ignored,       ///< ... and follows outside the domain of its model
  faults_hidden,        ///< impossible values reach the estimator as plausible ones
  always_valid,         ///< axes are marked valid although they are not driven
  epoch_ignored,        ///< the controller takes offsets of another epoch
  read_back_hidden,     ///< the estimator is told that all it sent is applied
  reload_from_nothing,  ///< a reload does not adopt
  forgotten_state       ///< load_state() does not load
};

struct WorldOptions {
  std::size_t steps{600};
  Planted planted{Planted::nothing};
  /// The second and third axis are the ends of a travel along "y_mm", or nodes of a table on it.
  bool travel{false};
  /// From this step on all readings are faulty, stale or impossible - or withheld altogether.
  std::optional<std::size_t> lost_from;
  bool lost_are_withheld{false};
  /// Every so many steps another model is promoted, or the one before comes back; 0: never.
  std::size_t promotion_every{0};
  /// At this step the estimator is replaced by a new one that loads its state.
  std::optional<std::size_t> reload_state_at;
};

struct Outcome {
  std::optional<Violation> violation;
  /// Every offset, target and valid bit of every step, as bits.
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
