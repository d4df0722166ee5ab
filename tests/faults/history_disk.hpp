/// The real history writer and its file on a disk that fills up, and a daemon that dies in the
/// middle of a write: what was committed must be there afterwards, and replay to the same bits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "daemon/history/writing/history_writer.hpp"
#include "fault_schedule.hpp"

namespace thermocomp::faults {

class HistoryDisk {
 public:
  /// @param folder  a new folder in it is used, and removed at the end
  HistoryDisk(const std::filesystem::path& folder, std::uint64_t seed,
              const FaultSchedule& schedule);
  HistoryDisk(const HistoryDisk&) = delete;
  HistoryDisk& operator=(const HistoryDisk&) = delete;
  ~HistoryDisk();

  void boot(const Grid& grid, nanoseconds now);
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const Estimator& estimator);
  void work(nanoseconds now);
  /// The process is gone, perhaps in the middle of a commit. The recorder must not be used again.
  void kill(nanoseconds now);
  /// As a service manager ends the daemon, once the recorder has said where it ends: everything is
  /// written, if the disk takes it.
  void end(std::uint64_t last_cycle, nanoseconds now);
  /// @return what is missing or different in the file; empty: nothing
  [[nodiscard]] std::string verify();
  [[nodiscard]] std::uint64_t commits() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::faults
