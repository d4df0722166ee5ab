/// A file that only one process at a time may use.
#pragma once

#include <filesystem>

#include "daemon/locks/lock_holder.hpp"

namespace thermocomp {

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

}  // namespace thermocomp
