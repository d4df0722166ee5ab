/// What of an estimator is to survive a restart, said once.
#pragma once

#include "estimator/estimator.hpp"

namespace thermocomp {

/// The counterpart of Estimator::restore(); allocates.
/// @param estimator  gives names and the model's own reference; its state is not read, so that a
///                   cycle may be stepping it
/// @param report     of that estimator (sizes are checked)
[[nodiscard]] PersistentState persistent_state(const Estimator& estimator, const Report& report);

/// Whether something differs that must be written at once: switch, references, what was learned
/// and held. Offsets and temperatures move all the time; they may wait.
[[nodiscard]] bool must_be_saved(const PersistentState& now, const PersistentState& saved);

}  // namespace thermocomp
