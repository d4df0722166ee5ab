/// Common parts of the command line programs: main(), exit statuses, actions of subcommands,
/// failures, and messages for wrong command lines.
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
inline constexpr int exit_no = 1;     ///< the answer is "no", or a check failed
inline constexpr int exit_error = 2;  ///< usage error, bad input, or unreachable

/// Action of the parsed command line; returns the exit status. Set by exactly one subcommand during
/// parsing, run by main() afterwards.
using Action = std::function<int()>;

/// Options before the subcommand.
struct GlobalOptions {
  std::string socket;  ///< path of the daemon's status socket
};

/// Ends the command with one line on stderr and this exit status.
class Failure : public std::runtime_error {
 public:
  explicit Failure(const std::string& what, int status = exit_error)
      : std::runtime_error(what), status_(status) {}
  [[nodiscard]] int status() const noexcept { return status_; }

 private:
  int status_;
};

/// main() of a program: ignores SIGPIPE, so that a closed pipe is a write error; parses; runs the
/// action; writes errors to stderr, with the program's name unless they name a place in a file.
/// A command that would write onto one of its inputs is refused.
/// @param declare  declares the command line; its references outlive the call
/// @param failed   exit status after an error other than ConfigurationError and Failure
/// @return the exit status; exit_error for a wrong command line or configuration
[[nodiscard]] int run_program(int argc, char** argv, const char* name,
                              const std::function<void(CLI::App&, Action&)>& declare,
                              int failed = exit_error);

/// Message for CLI::App::failure_message(). An unknown command: the word and the closest command. A
/// missing command: the existing ones. Else the text of CLI11.
[[nodiscard]] std::string command_error_text(const CLI::App* app, const CLI::Error& error);

}  // namespace thermocomp::cli
