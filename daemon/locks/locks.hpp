/// Locks for a file or a name that only one process of this machine may use at a time.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include <sys/types.h>

namespace thermocomp {

/// Another process holds the lock; the text names the lock and its holder.
class LockHeld : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The lock could not be created (folder missing, disk full, ...); a holder is not known.
class LockImpossible : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// "process 4711 (thermocompd /etc/thermocomp/thermocompd.toml)", as far as known.
[[nodiscard]] std::string describe_process(pid_t process);

/// Holds `<file>.lock` beside the file, after resolving links, so that a file with two paths has
/// one lock. The lock file names its holder. The kernel releases the lock when the process ends; an
/// orderly end also removes the lock file.
///
/// The file itself cannot be locked: a state file is replaced by saving, a damaged history is moved
/// aside.
class FileLock {
 public:
  /// @throws LockHeld, LockImpossible
  explicit FileLock(const std::filesystem::path& file);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  std::filesystem::path path_;
  int fd_{-1};
};

/// Lock for a name, such as a controller's address: a Unix socket in the abstract namespace. It
/// needs neither folder nor rights; the kernel frees it when the process ends and knows the holder.
/// Valid within a network namespace, as the address is.
///
/// Every user may bind any abstract name, so each holder binds `thermocomp/<name>/<random>`, which
/// cannot be guessed, and then looks for other holders of the name. A holder counts if it runs as
/// this process's user or as root (SO_PEERCRED).
class NameLock {
 public:
  /// @throws LockHeld, LockImpossible
  explicit NameLock(const std::string& name);
  ~NameLock();
  NameLock(NameLock&& other) noexcept;
  NameLock& operator=(NameLock&&) = delete;

  /// Accepts and closes pending queries for the holder; call about once a second. With a full
  /// backlog (thousands of queries) a further query fails and the holder goes unnoticed.
  void drain() noexcept;

 private:
  int fd_{-1};
};

}  // namespace thermocomp
