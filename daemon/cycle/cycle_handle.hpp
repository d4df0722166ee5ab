/// Main's side of the cycle: what was sent to it, what came of it, and what was not taken in time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "daemon/cycle/cycle.hpp"

namespace thermocomp {

/// The state of a command, or of new parts, on the way to the cycle.
enum class Outcome {
  waiting,
  done,       ///< the newest report says what it did
  withdrawn,  ///< not taken in time: it never happened and never will
  overdue     ///< the cycle has it in hand and does not finish; `done` may still come
};

/// Nothing here waits: poll() moves everything on. Main's thread only; time is an argument.
///
/// A change-over is whole or not at all: until poll() has finished it, parts() and report() are
/// those of the old parts, and what the cycle does not take within its patience is withdrawn in one
/// atomic step. So nothing is ever done that main believes refused, nor the other way round.
class CycleHandle {
 public:
  using Clock = std::chrono::steady_clock;
  using Tracked = std::shared_ptr<const Outcome>;
  /// Called by poll() for each command that is done, before its outcome becomes `done`.
  using CommandDone = std::function<void(const Command&)>;

  /// At 1 Hz a command takes up to 1 s.
  static constexpr Clock::duration patience = std::chrono::seconds(5);

  CycleHandle(Cycle& cycle, CommandDone command_done)
      : cycle_(cycle), command_done_(std::move(command_done)) {}

  /// @return none: too many are under way
  /// @pre replacing() is false for a command that names an axis: the new parts may number them
  ///      otherwise
  [[nodiscard]] Tracked send(const Command& command, Clock::time_point now);
  /// @pre !replacing()
  Tracked replace(std::unique_ptr<CycleParts> next, Clock::time_point now);
  /// Whether new parts are on their way: no others can be handed over until that is done or
  /// withdrawn.
  [[nodiscard]] bool replacing() const noexcept { return replacement_.outcome != nullptr; }
  /// Whether poll() has anything to do.
  [[nodiscard]] bool is_busy() const noexcept { return replacing() || !commands_.empty(); }

  /// What is done becomes `done`, what is late is withdrawn or becomes `overdue`.
  void poll(Clock::time_point now);
  /// After the cycle has ended: what it did is done, the rest is withdrawn.
  void settle();

  /// The report of the newest parts whose change-over is done.
  [[nodiscard]] const Report& report() { return cycle_.report(); }
  [[nodiscard]] const Estimator& estimator() { return cycle_.parts().estimator; }
  [[nodiscard]] Candidate* candidate() { return cycle_.parts().candidate.get(); }
  [[nodiscard]] const ControllerState& controller() { return cycle_.controller(); }
  [[nodiscard]] const CycleTiming& timing() const { return cycle_.timing(); }

 private:
  struct SentCommand {
    std::uint64_t number{0};
    Command command;
    Clock::time_point deadline;
    std::shared_ptr<Outcome> outcome;
  };
  struct Replacement {
    std::unique_ptr<CycleParts> staged;  ///< waits until no command that names an axis is under way
    Clock::time_point deadline;
    std::shared_ptr<Outcome> outcome;  ///< none: no parts is on its way
  };

  void finish_replacement();
  void finish_commands();
  void hand_over_staged();
  [[nodiscard]] bool withdraw_replacement();
  void end_replacement(Outcome outcome);

  Cycle& cycle_;
  CommandDone command_done_;
  std::vector<SentCommand> commands_;  ///< in the order in which they were sent
  Replacement replacement_;
};

/// Whether Command::axis is the index of an axis.
[[nodiscard]] constexpr bool names_axis(CommandKind kind) noexcept {
  return kind == CommandKind::measured || kind == CommandKind::prove ||
         kind == CommandKind::release || kind == CommandKind::saved;
}
/// Whether it is an index of the running configuration, and means another thing in the next one.
[[nodiscard]] constexpr bool has_index(CommandKind kind) noexcept {
  return names_axis(kind) || kind == CommandKind::accept;
}

}  // namespace thermocomp
