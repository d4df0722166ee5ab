#include "daemon/state/state_keeper.hpp"

#include <utility>

#include "daemon/state/state_file.hpp"
#include "estimator/pipeline/persistent_state.hpp"

namespace thermocomp {

StateKeeper::StateKeeper(std::filesystem::path file, PersistentState start, bool is_on_disk,
                         bool reference_lost, const ReferenceRecord& reference)
    : file_(std::move(file)),
      on_disk_{0, std::move(start), reference_lost, reference, 0},
      is_on_disk_(is_on_disk),
      reference_lost_(reference_lost),
      reference_(reference) {}

void StateKeeper::note(const PersistentState& state, Clock::time_point now) {
  poll(now);
  const bool is_due = now >= next_offsets_;
  if (must_be_written(state) || (is_due && state.offset_um != newest().state.offset_um))
    hand_over(state, now);
}

void StateKeeper::save(const PersistentState& state, Clock::time_point now) {
  poll(now);
  if (must_be_written(state) || state.offset_um != newest().state.offset_um) hand_over(state, now);
}

void StateKeeper::poll(Clock::time_point now) {
  now_ = now;
  if (writing_ == nullptr) return;
  if (thread_.is_busy()) {
    if (now - begun_ > disk_answers_within)
      error_ = "state file: the disk does not answer, nothing newer is saved until it does";
    return;
  }
  const std::shared_ptr<Writing> done = std::exchange(writing_, nullptr);
  attempted_ = done->what.serial;
  error_ = done->error;
  if (error_.empty()) {
    on_disk_ = std::move(done->what);
    is_on_disk_ = true;
  }
  if (waiting_) begin(*std::exchange(waiting_, std::nullopt), now);
}

bool StateKeeper::wait(Clock::duration at_most) {
  const Clock::time_point begun = Clock::now();
  const Clock::time_point given = now_;
  const auto waited = [begun] { return Clock::now() - begun; };
  poll(given);
  while (is_busy()) {
    const bool ended = thread_.wait(at_most - waited());
    poll(given + waited());
    if (!ended) return false;
  }
  return true;
}

StateKeeper::Saving StateKeeper::saving(std::uint64_t serial) const noexcept {
  if (serial <= on_disk_.serial && is_on_disk_) return Saving::on_disk;
  return serial <= attempted_ ? Saving::failed : Saving::under_way;
}

void StateKeeper::reference_taken() noexcept {
  if (!reference_lost_) return;
  reference_lost_ = false;
  ++references_;
}

void StateKeeper::note_reference(const ReferenceRecord& reference) noexcept {
  reference_ = reference;
  ++references_;
}

bool StateKeeper::must_be_written(const PersistentState& state) const {
  const SavedState& last = newest();
  return must_be_saved(state, last.state) || references_ != last.references ||
         (writing_ == nullptr && !is_on_disk_);
}

/// Handed over or on disk: what is written next must differ from it.
const SavedState& StateKeeper::newest() const noexcept {
  if (waiting_) return *waiting_;
  return writing_ != nullptr ? writing_->what : on_disk_;
}

void StateKeeper::hand_over(const PersistentState& state, Clock::time_point now) {
  next_offsets_ = now + offsets_saved_every;
  SavedState what{++serial_, state, reference_lost_, reference_, references_};
  if (writing_ != nullptr)
    waiting_ = std::move(what);
  else
    begin(std::move(what), now);
}

void StateKeeper::begin(SavedState what, Clock::time_point now) {
  begun_ = now;
  writing_ = std::make_shared<Writing>(Writing{std::move(what), {}});
  thread_.start([file = file_, writing = writing_] {
    const SavedState& state = writing->what;
    writing->error = save_state_file(file, state.state, state.reference_lost, state.reference);
  });
}

}  // namespace thermocomp
