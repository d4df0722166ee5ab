/// A name that only one process at a time may hold on this machine.
#pragma once

#include <string>

#include "daemon/locks/lock_holder.hpp"

namespace thermocomp {

/// For what is not a file: a controller's address. The name is bound as a Unix socket's in the
/// abstract namespace: no folder and no rights are needed, the kernel frees it however the process
/// ends, and knows who holds it. It counts within a network namespace, as the address does.
class NameLock {
 public:
  /// @throws LockHeld, LockImpossible
  explicit NameLock(const std::string& name);
  ~NameLock();
  NameLock(NameLock&& other) noexcept;
  NameLock& operator=(NameLock&&) = delete;

 private:
  int fd_{-1};
};

}  // namespace thermocomp
