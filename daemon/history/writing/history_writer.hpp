/// Writes the cycle's records to disk.
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

/// The writer's clocks.
struct WriterClocks {
  std::function<nanoseconds()> monotonic;  ///< of the grid
  std::function<nanoseconds()> wall;       ///< since 1970, may step
};
[[nodiscard]] WriterClocks system_clocks();

/// Statistics for the status.
struct HistoryStatistics {
  bool working{false};       ///< the last attempt to write succeeded
  std::uint64_t records{0};  ///< committed since the start
  std::uint64_t commits{0};
  std::uint64_t errors{0};    ///< failed attempts to open or write
  std::uint64_t lost{0};      ///< records lost: ring or memory full
  std::uint64_t gaps{0};      ///< segments that begin after a loss
  std::uint64_t segments{0};  ///< in the file
  std::uint64_t deleted{0};   ///< segments, for size or age
  std::uint64_t replaced{0};  ///< times that the file, its -wal or its -shm was replaced
  std::uint64_t bytes{0};     ///< size of the file, without its write-ahead log
  double last_commit_age_s{not_a_number};
  std::string last_error;  ///< empty after a successful attempt
};

/// Drains the ring on its own thread: fsync takes seconds on a worn SD card or a disk that spins
/// up, and a stalled disk must not keep main from feeding the watchdog or answering operators.
///
/// Size and age are bounded: the oldest whole segments are deleted first. The current segment is
/// never deleted, so it ends when it exceeds an eighth of the bound.
/// After disk full or an I/O error, records wait in memory (up to `memory_bytes_max`) and are
/// retried with growing pauses; beyond that they are dropped and counted, and a new segment begins.
class HistoryWriter {
 public:
  static constexpr std::size_t memory_bytes_max = 4u << 20;

  HistoryWriter(const HistoryConfig& config, const Grid& grid, std::string program_version,
                std::size_t ring_records = 65536, WriterClocks clocks = system_clocks());
  ~HistoryWriter();
  HistoryWriter(const HistoryWriter&) = delete;
  HistoryWriter& operator=(const HistoryWriter&) = delete;

  /// Creates the recorder of a configuration, also after a reload; it must not outlive the writer.
  /// Any ordinary thread.
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const SegmentSetup& setup,
                                                             const Estimator& estimator);
  /// Adds an event to the next commit. Any ordinary thread.
  void note(Event event);
  /// Opens the file and starts the thread. A damaged file is moved aside, with a message; a failing
  /// disk is retried without limit.
  /// @throws HistoryError when the file belongs to a newer version or another program, or is in use
  void start();
  /// For callers with their own clock and without the thread: start() without the thread, and the
  /// thread's work every 50 ms.
  void open();
  void work();
  /// Writes pending rows and closes the file. Gives up on a failing disk after one attempt.
  void stop() noexcept;
  /// The same with a time-out.
  /// @return false if it still runs, until the process ends
  [[nodiscard]] bool stop_within(std::chrono::seconds at_most) noexcept;
  [[nodiscard]] HistoryStatistics statistics() const;
  /// Messages about rows or files since the last call, one sentence each. Any ordinary thread.
  [[nodiscard]] std::vector<std::string> take_messages();

 private:
  void ask_to_stop() noexcept;

  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
