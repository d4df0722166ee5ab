#include "daemon/state/state_keeper.hpp"

#include "daemon/state/state_file.hpp"
#include "estimator/pipeline/persistent_state.hpp"

namespace thermocomp {

void StateKeeper::note(const PersistentState& state, Clock::time_point now) {
  const bool is_due = now >= next_offsets_;
  if (must_be_saved(state, saved_) || !is_on_disk_ ||
      (is_due && state.offset_um != saved_.offset_um))
    write(state, now);
}

void StateKeeper::save(const PersistentState& state, Clock::time_point now) {
  if (must_be_saved(state, saved_) || !is_on_disk_ || state.offset_um != saved_.offset_um)
    write(state, now);
}

void StateKeeper::reference_taken() noexcept {
  if (!reference_lost_) return;
  reference_lost_ = false;
  is_on_disk_ = false;
}

void StateKeeper::note_reference(const ReferenceRecord& reference) noexcept {
  reference_ = reference;
  is_on_disk_ = false;
}

void StateKeeper::write(const PersistentState& state, Clock::time_point now) {
  next_offsets_ = now + offsets_saved_every;
  error_ = save_state_file(file_, state, reference_lost_, reference_);
  if (!error_.empty()) return;
  saved_ = state;
  is_on_disk_ = true;
}

}  // namespace thermocomp
