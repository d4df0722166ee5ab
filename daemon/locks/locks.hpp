/// What only one process of this machine may use at a time: a file, or a name.
#pragma once

#include <filesystem>
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

/// Holds `<file>.lock` beside the file, under the name that the file has once every link is
/// followed, so that one file with two paths has one lock. It names its holder. The kernel releases
/// it however the process ends; at an orderly end the lock file goes too.
///
/// The file itself cannot carry the lock: a state file is replaced at every save, a damaged history
/// is moved aside.
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
