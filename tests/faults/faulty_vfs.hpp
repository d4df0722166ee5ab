/// SQLite file system of one thread's life: writes that need space fail while the disk is full, and
/// all writes fail once the process is dying.
#pragma once

#include <cstdint>

namespace thermocomp::faults {

struct DiskState {
  bool full{false};
  bool dying{false};  ///< after `writes_left` more writes all writes fail
  std::uint64_t writes_left{0};
  std::uint64_t refused{0};
};

/// Becomes SQLite's default for the whole program; each thread's files use that thread's disk.
void install_faulty_vfs();
void set_disk_of_this_thread(DiskState* disk) noexcept;

}  // namespace thermocomp::faults
