/// What is thrown when something is already in use; says by whom.
#pragma once

#include <stdexcept>
#include <string>

#include <sys/types.h>

namespace thermocomp {

/// Another process holds the lock; the text says what is locked and who has it.
class LockHeld : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The lock could not be made at all (folder missing, disk full, ...), so nobody is known to hold
/// it.
class LockImpossible : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// "process 4711 (thermocompd /etc/thermocomp/thermocompd.toml)", as far as it is known; the
/// command line names the configuration.
[[nodiscard]] std::string describe_process(pid_t process);

}  // namespace thermocomp
