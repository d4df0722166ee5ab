/// What survives a restart, by name: a small JSON file that is either the old or the new one,
/// whatever happens while it is written; and who keeps it on disk and knows what is there.
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
  unknown,       ///< of a state file that does not say, or of the history
  first_values,  ///< the first good values of a start, or of inputs that came new
  command,       ///< an operator's `reference`
  reload         ///< a configuration or model that was taken over
};
/// As it stands in JSON: "operator", "first_values", "reload"; empty: unknown.
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

/// When the reference was taken, and by whom: for people, nothing is computed from it.
struct ReferenceRecord {
  double wall_s{not_a_number};  ///< seconds since 1970, as the clock stood then; NaN: not known
  ReferenceOrigin origin{ReferenceOrigin::unknown};
  [[nodiscard]] bool is_known() const noexcept {
    return std::isfinite(wall_s) && origin != ReferenceOrigin::unknown;
  }
};

struct LoadedState {
  PersistentState state;
  bool found{false};    ///< a good file was there; otherwise `state` is the caller's fallback
  bool damaged{false};  ///< something was there that could not be used
  std::string warning;  ///< what, for the log; not empty where `damaged`, memory permitting
  /// The reference in it was taken because the right one had been lost (see StateKeeper).
  bool reference_lost{false};
  ReferenceRecord reference;  ///< unknown where the file does not say
};

/// Never throws: a damaged or foreign file is moved aside (`<file>.unusable`), one of a newer
/// format too (`<file>.format-N`), and reported in `warning`.
/// @param fallback  returned where there is no usable file
[[nodiscard]] LoadedState load_state_file(const std::filesystem::path& file,
                                          const PersistentState& fallback) noexcept;

/// Writes beside the file, flushes to the disk, renames over it, flushes the folder.
/// @return empty, or what went wrong; the old file then still stands
[[nodiscard]] std::string save_state_file(const std::filesystem::path& file,
                                          const PersistentState& state, bool reference_lost = false,
                                          const ReferenceRecord& reference = {}) noexcept;

/// A state on its way to the disk, or there.
struct SavedState {
  std::uint64_t serial{0};  ///< rises with each one that is handed over; 0: the one at the start
  PersistentState state;
  bool reference_lost{false};
  ReferenceRecord reference;
  std::uint64_t references{0};  ///< changes of the two above until then
};

/// A thread of its own writes; main hands states over and waits for no disk. While one is being
/// written, the newest one waits and any older one is skipped. Main's thread only; time is an
/// argument.
class StateKeeper {
 public:
  using Clock = std::chrono::steady_clock;
  /// Offsets and temperatures alone, which change all the time, are written this often.
  static constexpr Clock::duration offsets_saved_every = std::chrono::seconds(10);
  /// A disk that takes longer is a problem of which error() speaks.
  static constexpr Clock::duration disk_answers_within = std::chrono::seconds(5);

  /// @param start           the daemon's at its start; only what differs from it is written
  /// @param is_on_disk      `start` need not be written
  /// @param reference_lost  the reference of `start` is not the machine's, which nobody knows
  /// @param reference       when the reference of `start` was taken
  StateKeeper(std::filesystem::path file, PersistentState start, bool is_on_disk,
              bool reference_lost, const ReferenceRecord& reference = {});

  /// Hands over what must be written at once, and the rest when it is due.
  void note(const PersistentState& state, Clock::time_point now);
  /// Hands over whatever differs from what was handed over last.
  void save(const PersistentState& state, Clock::time_point now);
  /// Takes what the thread has done, and gives it what waits.
  void poll(Clock::time_point now);
  /// Until nothing is under way. @return false: it still is, after `at_most`
  bool wait(Clock::duration at_most);

  /// The newest state that is on disk for certain, flushed; its serial rises when a newer one is.
  [[nodiscard]] const SavedState& on_disk() const noexcept { return on_disk_; }
  /// Of what was handed over last.
  [[nodiscard]] std::uint64_t serial() const noexcept { return serial_; }
  enum class Saving { under_way, on_disk, failed };
  /// What has become of the state with that serial: `on_disk` also by a newer one, `failed` also
  /// where a newer one is under way.
  [[nodiscard]] Saving saving(std::uint64_t serial) const noexcept;
  [[nodiscard]] bool is_busy() const noexcept { return writing_ != nullptr; }

  /// What went wrong at the last attempt; empty: what was given last is on disk or on its way.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

  /// Until an operator takes a new one, the reference is unknown: compensating would count
  /// displacement from how the machine stood when the daemon happened to start. Kept in the file.
  [[nodiscard]] bool is_reference_lost() const noexcept { return reference_lost_; }
  /// An operator has taken a reference. Written with the next save().
  void reference_taken() noexcept;

  /// When the reference was taken. Written with the next save().
  void note_reference(const ReferenceRecord& reference) noexcept;
  [[nodiscard]] const ReferenceRecord& reference() const noexcept { return reference_; }

 private:
  /// One attempt: the thread's until it has ended.
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
  Clock::time_point now_{};  ///< as it was given last
  Clock::time_point next_offsets_{};
  std::uint64_t serial_{0};
  std::uint64_t attempted_{0};         ///< of the last attempt that has ended
  std::shared_ptr<Writing> writing_;   ///< none: nothing is under way
  std::optional<SavedState> waiting_;  ///< for the one under way; newer than it
  Clock::time_point begun_{};
  SideThread thread_{"state"};
};

}  // namespace thermocomp
