/// SQLite's file system for the lives of this thread: writes that would need room fail while the
/// disk is full, and all fail once the process is as good as dead.
#pragma once

#include <cstdint>

namespace thermocomp::faults {

struct DiskState {
  bool full{false};
  bool dying{false};  ///< after `writes_left` more writes nothing reaches the disk
  std::uint64_t writes_left{0};
  std::uint64_t refused{0};
};

/// Becomes SQLite's default for the whole program; files opened by a thread obey its disk.
void install_faulty_vfs();
void set_disk_of_this_thread(DiskState* disk) noexcept;

}  // namespace thermocomp::faults
