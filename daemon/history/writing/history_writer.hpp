/// Puts what the cycle recorded on disk.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/history/format/segments.hpp"
#include "daemon/recording/cycle_recorder.hpp"
#include "daemon/recording/record.hpp"
#include "status/event.hpp"

namespace thermocomp {

/// Where the writer gets its times from.
struct WriterClocks {
  std::function<nanoseconds()> monotonic;  ///< the grid's
  std::function<nanoseconds()> wall;       ///< since 1970, may be stepped
};
[[nodiscard]] WriterClocks system_clocks();

/// For the operator.
struct HistoryStatistics {
  bool working{false};       ///< the last attempt to write succeeded
  std::uint64_t records{0};  ///< committed since the start
  std::uint64_t commits{0};
  std::uint64_t errors{0};    ///< failed attempts to open or write
  std::uint64_t lost{0};      ///< records lost: ring or memory full
  std::uint64_t gaps{0};      ///< segments that begin after a loss
  std::uint64_t segments{0};  ///< in the file
  std::uint64_t deleted{0};   ///< segments, for size or age
  std::uint64_t replaced{0};  ///< times that the file, its -wal or its -shm was not ours any more
  std::uint64_t bytes{0};     ///< of the file, without its write-ahead log
  double last_commit_age_s{not_a_number};
  std::string last_error;  ///< empty when the last attempt was good
};

/// Drains the ring on a thread of its own. Not on main, where the watchdog is fed and the
/// operators' socket answered: fsync on a worn SD card or a disk that spins up takes seconds, and a
/// stalled disk must neither get the daemon killed nor leave an operator without an answer.
///
/// Bounded by size and age: the oldest whole segments go first; the segment being written never
/// does, so one that grows beyond an eighth of the bound is ended and another begun.
/// Disk full, I/O error: what is recorded waits in memory (up to `memory_bytes_max`) and is tried
/// again with growing pauses; beyond that it is dropped, counted, and the next segment starts
/// fresh.
class HistoryWriter {
 public:
  static constexpr std::size_t memory_bytes_max = 4u << 20;

  /// Opens nothing yet.
  HistoryWriter(const HistoryConfig& config, const Grid& grid, std::string program_version,
                std::size_t ring_records = 65536, WriterClocks clocks = system_clocks());
  ~HistoryWriter();
  HistoryWriter(const HistoryWriter&) = delete;
  HistoryWriter& operator=(const HistoryWriter&) = delete;

  /// A recorder for one configuration; again after a reload. Any ordinary thread. The recorder must
  /// not outlive the writer.
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const SegmentSetup& setup,
                                                             const Estimator& estimator);
  /// Something has happened; it is on disk with the next commit. Any ordinary thread.
  void note(Event event);
  /// Opens the file and starts the thread. A damaged file is moved aside, which is among the news;
  /// a disk that does not work is tried again for ever.
  /// @throws HistoryError when the file is of a newer version or of another program, or another
  ///         process writes it
  void start();
  /// What start() does before it starts the thread, and what the thread does every 50 ms: for
  /// callers with a time of their own and no thread.
  void open();
  void work();
  /// Writes what is left and closes the file. Gives up on a disk that does not work after one try.
  void stop() noexcept;
  /// The same for a caller that waits for no disk.
  /// @return false: it has not ended, and only the end of the process will end it
  [[nodiscard]] bool stop_within(std::chrono::seconds at_most) noexcept;
  [[nodiscard]] HistoryStatistics statistics() const;
  /// What happened to rows or files since the last call, one sentence each. Any ordinary thread.
  [[nodiscard]] std::vector<std::string> take_news();

 private:
  void ask_to_stop() noexcept;

  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
