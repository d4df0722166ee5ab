/// What every command group of `thermocomp` shares: exit statuses, how a group hands its work to
/// main(), and the failure that ends a command with one line.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

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

}  // namespace thermocomp::cli
