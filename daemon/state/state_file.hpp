/// The state that survives a restart, in a small JSON file that is replaced atomically, and the
/// thread that saves it.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/threads/side_thread.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

enum class ReferenceOrigin : std::uint8_t {
  unknown,       ///< from the history, or a state file without origin
  first_values,  ///< first good values after a start, or of new inputs
  command,       ///< operator's `reference` command
  reload         ///< taken over with a configuration or model
};
/// Name in JSON: "operator", "first_values", "reload"; empty: unknown.
[[nodiscard]] constexpr std::string_view to_string(ReferenceOrigin origin) noexcept {
  switch (origin) {
    case ReferenceOrigin::command:
      return "operator";
    case ReferenceOrigin::first_values:
      return "first_values";
    case ReferenceOrigin::reload:
      return "reload";
    case ReferenceOrigin::unknown:
      break;
  }
  return "";
}

/// Seconds since 1970 by the wall clock, which may be wrong or set.
[[nodiscard]] inline double wall_now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// Time and origin of the reference; informative only.
struct ReferenceRecord {
  double wall_s{not_a_number};  ///< seconds since 1970, by the clock at that time; NaN: unknown
  ReferenceOrigin origin{ReferenceOrigin::unknown};
  /// Change that contradicts a reference taken automatically, seen afterwards: "bed_degC +12.0
  /// K/h".
  std::string changed{};
  [[nodiscard]] bool is_known() const noexcept {
    return std::isfinite(wall_s) && origin != ReferenceOrigin::unknown;
  }
};

struct LoadedState {
  PersistentState state;
  bool found{false};    ///< a good file was read; otherwise `state` is the caller's fallback
  bool damaged{false};  ///< a file exists but cannot be used
  std::string warning;  ///< for the log; not empty if `damaged`, memory permitting
  /// The reference in `state` was taken after the right one had been lost (see StateKeeper).
  bool reference_lost{false};
  ReferenceRecord reference;  ///< unknown if not in the file
};

/// Moves a damaged or foreign file aside (`<file>.unusable`), also one of a newer format
/// (`<file>.format-N`), and reports it in `warning`. Never throws.
/// @param fallback  returned if there is no usable file
[[nodiscard]] LoadedState load_state_file(const std::filesystem::path& file,
                                          const PersistentState& fallback) noexcept;

/// Writes beside the file, flushes to the disk, renames over it, flushes the folder.
/// @return empty, or an error; the old file is then intact
[[nodiscard]] std::string save_state_file(const std::filesystem::path& file,
                                          const PersistentState& state, bool reference_lost = false,
                                          const ReferenceRecord& reference = {}) noexcept;

/// A state that is on disk or being saved.
struct SavedState {
  std::uint64_t serial{0};  ///< incremented with each hand-over; 0: the state at start
  PersistentState state;
  bool reference_lost{false};
  ReferenceRecord reference;
  std::uint64_t references{0};  ///< number of changes of the two above
};

/// Saves states on a thread of its own; main never waits for the disk. During a write the newest
/// state waits and older ones are skipped. Main's thread only; time is an argument.
class StateKeeper {
 public:
  using Clock = std::chrono::steady_clock;
  /// Offsets and temperatures change continuously and are written with this period.
  static constexpr Clock::duration offsets_saved_every = std::chrono::seconds(10);
  /// Time-out after which error() reports the disk.
  static constexpr Clock::duration disk_answers_within = std::chrono::seconds(5);

  /// @param start           the state at start; only changes from it are written
  /// @param is_on_disk      true if `start` need not be written
  /// @param reference_lost  the machine's reference is unknown; that of `start` is not valid
  /// @param reference       origin of the reference of `start`
  StateKeeper(std::filesystem::path file, PersistentState start, bool is_on_disk,
              bool reference_lost, const ReferenceRecord& reference = {});

  /// Hands over urgent changes at once, others when they are due.
  void note(const PersistentState& state, Clock::time_point now);
  /// Hands over any change since the last hand-over.
  void save(const PersistentState& state, Clock::time_point now);
  /// Collects a finished write and starts the waiting one.
  void poll(Clock::time_point now);
  /// Waits until no write is under way. @return false if one still is after `at_most`
  bool wait(Clock::duration at_most);

  /// The newest state that is flushed to disk.
  [[nodiscard]] const SavedState& on_disk() const noexcept { return on_disk_; }
  /// Serial of the last state handed over.
  [[nodiscard]] std::uint64_t serial() const noexcept { return serial_; }
  enum class Saving { under_way, on_disk, failed };
  /// State of saving that serial: `on_disk` also if a newer one is, `failed` also while a newer one
  /// is being written.
  [[nodiscard]] Saving saving(std::uint64_t serial) const noexcept;
  [[nodiscard]] bool is_busy() const noexcept { return writing_ != nullptr; }

  /// Error of the last attempt, or empty.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

  /// True if the machine's reference is unknown until an operator takes a new one; displacement
  /// would be relative to the state at the daemon's start. Saved in the file.
  [[nodiscard]] bool is_reference_lost() const noexcept { return reference_lost_; }
  /// Call when an operator has taken a reference. Saved with the next save().
  void reference_taken() noexcept;

  /// Sets the reference's origin. Saved with the next save().
  void note_reference(const ReferenceRecord& reference) noexcept;
  [[nodiscard]] const ReferenceRecord& reference() const noexcept { return reference_; }

 private:
  /// One attempt; owned by the thread until it ends.
  struct Writing {
    SavedState what;
    std::string error;
  };

  [[nodiscard]] bool must_be_written(const PersistentState& state) const;
  [[nodiscard]] const SavedState& newest() const noexcept;
  void hand_over(const PersistentState& state, Clock::time_point now);
  void begin(SavedState what, Clock::time_point now);

  std::filesystem::path file_;
  SavedState on_disk_;
  bool is_on_disk_;
  bool reference_lost_;
  ReferenceRecord reference_;
  std::uint64_t references_{0};
  std::string error_;
  Clock::time_point now_{};  ///< last time given
  Clock::time_point next_offsets_{};
  std::uint64_t serial_{0};
  std::uint64_t attempted_{0};         ///< serial of the last finished attempt
  std::shared_ptr<Writing> writing_;   ///< null: no write is under way
  std::optional<SavedState> waiting_;  ///< written after the present one
  Clock::time_point begun_{};
  SideThread thread_{"state"};
};

}  // namespace thermocomp
