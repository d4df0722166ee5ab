/// What the programs with a command line share: main(), exit statuses, how a group of commands
/// hands its work to main(), the failure that ends a command with one line, and what is said of a
/// command line that cannot be taken.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
class Error;
}  // namespace CLI

namespace thermocomp::cli {

/// Exit statuses of `thermocomp`, the same for all commands.
inline constexpr int exit_success = 0;
inline constexpr int exit_no = 1;       ///< the answer is "no", or a check failed
inline constexpr int exit_bad_use = 2;  ///< bad use, bad input, or unreachable

/// What the parsed command line asks for; returns the exit status. Set by exactly one subcommand
/// while the command line is parsed, run by main() afterwards.
using Action = std::function<int()>;

/// Options before the subcommand.
struct GlobalOptions {
  std::string socket;  ///< path of the daemon's status socket
};

/// Ends the command: one line on stderr, then this exit status.
class Failure : public std::runtime_error {
 public:
  explicit Failure(const std::string& what, int status = exit_bad_use)
      : std::runtime_error(what), status_(status) {}
  [[nodiscard]] int status() const noexcept { return status_; }

 private:
  int status_;
};

/// What main() of a program does: ignores SIGPIPE, so that a closed pipe is an error of writing;
/// parses; runs the action; writes an error to stderr, with the program's name before it unless it
/// names a file's place.
/// @param declare  the command line; what it refers to outlives the call
/// @param failed   exit status after an error that is neither of a configuration nor a Failure
/// @return the exit status; exit_bad_use where the command line or a configuration cannot be taken
[[nodiscard]] int run_program(int argc, char** argv, const char* name,
                              const std::function<void(CLI::App&, Action&)>& declare,
                              int failed = exit_bad_use);

/// A word that should have been a command, of the program or of a group of commands: by that word
/// and the command that was probably meant. None at all: by those that there are. Anything else as
/// CLI11 says it.
/// For CLI::App::failure_message().
[[nodiscard]] std::string command_slip_text(const CLI::App* app, const CLI::Error& error);

}  // namespace thermocomp::cli
