/// The real history writer on a disk that fills up, with a daemon killed during writes: committed
/// records must be present afterwards and replay bit for bit.
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
  /// @param folder  parent of a new folder, which is removed at the end
  HistoryDisk(const std::filesystem::path& folder, std::uint64_t seed,
              const FaultSchedule& schedule);
  HistoryDisk(const HistoryDisk&) = delete;
  HistoryDisk& operator=(const HistoryDisk&) = delete;
  ~HistoryDisk();

  void boot(const Grid& grid, nanoseconds now);
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const Estimator& estimator);
  void work(nanoseconds now);
  /// The process dies, possibly during a commit. The recorder must not be used again.
  void kill(nanoseconds now);
  /// Orderly end, after the recorder's last cycle: everything is written if the disk accepts it.
  void end(std::uint64_t last_cycle, nanoseconds now);
  /// @return description of missing or different records; empty: none
  [[nodiscard]] std::string verify();
  [[nodiscard]] std::uint64_t commits() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::faults
