/// Main's side of the cycle: sends commands and new parts and tracks their outcome.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "daemon/cycle/cycle.hpp"

namespace thermocomp {

/// The state of a command, or of new parts, sent to the cycle.
enum class Outcome {
  waiting,
  done,       ///< the newest report includes its effect
  withdrawn,  ///< not taken in time: it will never be carried out
  overdue     ///< taken but not finished in time; may still become `done`
};

/// Nothing here blocks; poll() advances all operations. Main's thread only; time is an argument.
///
/// A change-over is atomic: until poll() has finished it, Cycle::parts() and report() belong to the
/// old parts. A command or parts that the cycle does not take within `patience` are withdrawn in
/// one atomic step, so that main and cycle always agree on what was carried out.
class CycleHandle {
 public:
  using Clock = std::chrono::steady_clock;
  using Tracked = std::shared_ptr<const Outcome>;
  /// Called by poll() for each finished command, before its outcome becomes `done`.
  using CommandDone = std::function<void(const Command&)>;

  /// Longer than the 1 s that a command takes at a rate of 1 Hz.
  static constexpr Clock::duration patience = std::chrono::seconds(5);

  CycleHandle(Cycle& cycle, CommandDone command_done)
      : cycle_(cycle), command_done_(std::move(command_done)) {}

  /// @return null if too many commands are under way
  /// @pre !replacing() for a command that names an axis: the new parts may number axes differently
  [[nodiscard]] Tracked send(const Command& command, Clock::time_point now);
  /// @pre !replacing()
  Tracked replace(std::unique_ptr<CycleParts> next, Clock::time_point now);
  /// True while new parts are under way; they must be done or withdrawn before others can follow.
  [[nodiscard]] bool replacing() const noexcept { return replacement_.outcome != nullptr; }
  [[nodiscard]] bool is_busy() const noexcept { return replacing() || !commands_.empty(); }

  /// Marks finished operations `done`; withdraws late ones or marks them `overdue`.
  void poll(Clock::time_point now);
  /// Call after the cycle has ended. Marks finished operations and withdraws the rest.
  void settle();

 private:
  struct SentCommand {
    std::uint64_t number{0};
    Command command;
    Clock::time_point deadline;
    std::shared_ptr<Outcome> outcome;
  };
  struct Replacement {
    std::unique_ptr<CycleParts> staged;  ///< held back while an axis command is under way
    Clock::time_point deadline;
    std::shared_ptr<Outcome> outcome;  ///< null: no parts are under way
  };

  void finish_replacement();
  void finish_commands();
  void hand_over_staged();
  [[nodiscard]] bool withdraw_replacement();
  void end_replacement(Outcome outcome);

  Cycle& cycle_;
  CommandDone command_done_;
  std::vector<SentCommand> commands_;  ///< in the order sent
  Replacement replacement_;
};

/// True if Command::axis is the index of an axis.
[[nodiscard]] constexpr bool names_axis(CommandKind kind) noexcept {
  return kind == CommandKind::measured || kind == CommandKind::prove ||
         kind == CommandKind::release || kind == CommandKind::saved;
}
/// True if Command::axis is an index that depends on the configuration.
[[nodiscard]] constexpr bool has_index(CommandKind kind) noexcept {
  return names_axis(kind) || kind == CommandKind::accept;
}

}  // namespace thermocomp
