/// A name that only one process at a time may hold on this machine.
#pragma once

#include <string>

#include "daemon/locks/lock_holder.hpp"

namespace thermocomp {

/// For what is not a file: a controller's address. The lock is a Unix socket in the abstract
/// namespace: it needs no folder and no rights, the kernel frees it however the process ends, and
/// the kernel knows who holds it. It counts within a network namespace, as the address does.
///
/// Every user may bind any abstract name. Each holder therefore binds `thermocomp/<name>/<random>`,
/// which nobody can take in advance, and only then looks for other holders of the name. A holder
/// counts if it runs as this process's user or as root (SO_PEERCRED); one of another user is
/// ignored.
class NameLock {
 public:
  /// @throws LockHeld, LockImpossible
  explicit NameLock(const std::string& name);
  ~NameLock();
  NameLock(NameLock&& other) noexcept;
  NameLock& operator=(NameLock&&) = delete;

  /// Takes what others have left who asked for the holder: once a second, say. Where thousands
  /// wait, the kernel tells the next one nothing about the holder, which then does not count.
  void drain() noexcept;

 private:
  int fd_{-1};
};

}  // namespace thermocomp
