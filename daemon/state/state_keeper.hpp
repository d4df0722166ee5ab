/// Keeps what must survive a restart on disk, and knows what is there.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "daemon/state/reference_record.hpp"
#include "estimator/pipeline/persistent_state.hpp"

namespace thermocomp {

/// Main's thread only; time is an argument.
class StateKeeper {
 public:
  using Clock = std::chrono::steady_clock;
  /// Offsets and temperatures alone, which change all the time, are written this often.
  static constexpr Clock::duration offsets_saved_every = std::chrono::seconds(10);

  /// @param start           the daemon's at its start; only what differs from it is written
  /// @param is_on_disk      `start` need not be written
  /// @param reference_lost  the reference of `start` is not the machine's, which nobody knows
  /// @param reference       when the reference of `start` was taken
  StateKeeper(std::filesystem::path file, PersistentState start, bool is_on_disk,
              bool reference_lost, const ReferenceRecord& reference = {})
      : file_(std::move(file)),
        saved_(std::move(start)),
        is_on_disk_(is_on_disk),
        reference_lost_(reference_lost),
        reference_(reference) {}

  /// Writes what must be written at once, and the rest when it is due.
  void note(const PersistentState& state, Clock::time_point now);
  /// Writes whatever differs from what is on disk.
  void save(const PersistentState& state, Clock::time_point now);

  /// What went wrong at the last attempt; empty: what was given last is on disk.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

  /// Until an operator takes a new one, the reference is unknown: compensating would take the
  /// machine for straight as it stood when the daemon happened to start. Kept in the file.
  [[nodiscard]] bool is_reference_lost() const noexcept { return reference_lost_; }
  /// An operator has taken a reference. Written with the next save().
  void reference_taken() noexcept;

  /// When the reference was taken. Written with the next save().
  void note_reference(const ReferenceRecord& reference) noexcept;
  [[nodiscard]] const ReferenceRecord& reference() const noexcept { return reference_; }

 private:
  void write(const PersistentState& state, Clock::time_point now);

  std::filesystem::path file_;
  PersistentState saved_;
  bool is_on_disk_;
  bool reference_lost_;
  ReferenceRecord reference_;
  std::string error_;
  Clock::time_point next_offsets_{};
};

}  // namespace thermocomp
