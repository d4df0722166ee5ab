#include "history_disk.hpp"

#include <fmt/format.h>
#include <map>
#include <set>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/replay.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "faulty_vfs.hpp"

namespace thermocomp::faults {
namespace {

constexpr nanoseconds wall_at_begin = std::chrono::seconds(1'780'000'000);  // in 2026

/// Cycles of one run that the file contained after a successful commit.
struct Committed {
  nanoseconds grid_start{};
  std::uint64_t from{0};
  std::uint64_t to{0};
};

}  // namespace

struct HistoryDisk::Parts {
  std::filesystem::path folder;
  const FaultSchedule& schedule;
  Chance chance;
  DiskState disk;
  nanoseconds now{};
  nanoseconds wrong_for_good{};          ///< permanent error of the wall clock
  std::uint64_t files_removed_event{0};  ///< the last removal carried out
  Grid grid;
  std::unique_ptr<HistoryWriter> writer;
  std::vector<ReplaySetup> setups;
  std::vector<Committed> committed;
  std::uint64_t commits_seen{0};
  std::uint64_t commits_all{0};
  std::uint64_t lost_seen{0};
  std::uint64_t next_cycle{0};                              ///< first cycle not yet committed
  std::uint64_t last_step{0};                               ///< the cycle stepped last
  std::map<std::int64_t, std::set<std::uint64_t>> skipped;  ///< by overruns, per run

  Parts(std::uint64_t seed, const FaultSchedule& fault_schedule)
      : schedule(fault_schedule), chance(seed, 11) {}

  /// Every other large step is permanent; no further steps follow it.
  [[nodiscard]] nanoseconds wall() {
    if (wrong_for_good != nanoseconds{}) return wall_at_begin + now + wrong_for_good;
    const FaultEvent* step = schedule.find(FaultKind::wall_clock_stepped, now);
    nanoseconds stepped{0};
    if (step != nullptr) {
      if (step->strength < 0.25)
        stepped = -wall_at_begin;
      else if (step->strength < 0.5)
        stepped = -std::chrono::hours(1);
      else
        stepped = std::chrono::hours(step->strength < 0.75 ? 1 : 24 * 400);
      if (step->strength >= 0.75 && step->number % 2 == 0) wrong_for_good = stepped;
    }
    return wall_at_begin + now + stepped;
  }
  /// Somebody deletes SQLite's auxiliary files.
  void remove_files() {
    const FaultEvent* event = schedule.find(FaultKind::history_files_removed, now);
    if (event == nullptr || event->number == files_removed_event) return;
    files_removed_event = event->number;
    std::error_code ignored;
    if (event->strength < 0.7) std::filesystem::remove(folder / "history.db-wal", ignored);
    if (event->strength > 0.4) std::filesystem::remove(folder / "history.db-shm", ignored);
  }
  [[nodiscard]] HistoryConfig config() const {
    HistoryConfig history;
    history.file = folder / "history.db";
    history.size_MB_max = 64.0;
    history.offsets_period_s = 3.0;  // several cycles, as in RecordedTwin
    history.commit_s = 9.0;
    history.segment_h = 0.5;
    return history;
  }
};

HistoryDisk::HistoryDisk(const std::filesystem::path& folder, std::uint64_t seed,
                         const FaultSchedule& schedule)
    : parts_(std::make_unique<Parts>(seed, schedule)) {
  install_faulty_vfs();
  parts_->folder = folder / fmt::format("life-{}", seed);
  std::filesystem::remove_all(parts_->folder);
  std::filesystem::create_directories(parts_->folder);
}

HistoryDisk::~HistoryDisk() {
  set_disk_of_this_thread(nullptr);
  parts_->writer.reset();
  std::error_code ignored;
  std::filesystem::remove_all(parts_->folder, ignored);
}

void HistoryDisk::boot(const Grid& grid, nanoseconds now) {
  Parts& parts = *parts_;
  parts.now = now;
  parts.grid = grid;
  parts.disk.dying = false;
  set_disk_of_this_thread(&parts.disk);
  parts.writer = std::make_unique<HistoryWriter>(
      parts.config(), grid, "fault simulation", 16384,
      WriterClocks{[&parts] { return parts.now; }, [&parts] { return parts.wall(); }});
  parts.writer->open();
  parts.commits_seen = 0;
  parts.lost_seen = 0;
  parts.next_cycle = 0;
  parts.last_step = 0;
}

std::unique_ptr<CycleRecorder> HistoryDisk::make_recorder(const Estimator& estimator) {
  parts_->setups.push_back({estimator.config(), estimator.model()});
  return parts_->writer->make_recorder({fmt::format("{}", parts_->setups.size() - 1), "", ""},
                                       estimator);
}

void HistoryDisk::work(nanoseconds now) {
  Parts& parts = *parts_;
  parts.now = now;
  parts.disk.full = parts.schedule.find(FaultKind::history_disk_full, now) != nullptr;
  parts.remove_files();
  parts.writer->work();
  const auto cycle_now = static_cast<std::uint64_t>((now - parts.grid.start) / parts.grid.period);
  while (++parts.last_step < cycle_now)
    parts.skipped[parts.grid.start.count()].insert(parts.last_step);
  parts.last_step = cycle_now;
  const HistoryStatistics statistics = parts.writer->statistics();
  const bool lost = statistics.lost != parts.lost_seen;
  if (statistics.commits == parts.commits_seen && !lost) return;
  // The recorder reports once a second the cycle up to which records are complete.
  const auto lag = static_cast<std::uint64_t>(std::chrono::seconds(1) / parts.grid.period);
  const auto cycle = static_cast<std::uint64_t>((now - parts.grid.start) / parts.grid.period);
  const std::uint64_t whole = cycle + 1 >= lag ? cycle + 1 - lag : 0;
  if (!lost && whole >= parts.next_cycle) {
    parts.committed.push_back({parts.grid.start, parts.next_cycle, whole});
    ++parts.commits_all;
  }
  parts.commits_seen = statistics.commits;
  parts.lost_seen = statistics.lost;
  parts.next_cycle = (lost ? cycle : whole) + 1;
}

void HistoryDisk::kill(nanoseconds now) {
  Parts& parts = *parts_;
  parts.disk.dying = true;
  parts.disk.writes_left = parts.chance.below(12);
  if (parts.chance.one_in(2)) {  // during a commit, which is due by then
    parts.now = now + std::chrono::minutes(2);
    parts.writer->work();
  }
  parts.disk.writes_left = 0;
  parts.writer.reset();
}

void HistoryDisk::end(std::uint64_t last_cycle, nanoseconds now) {
  Parts& parts = *parts_;
  parts.now = now + std::chrono::minutes(2);  // the commit is due
  parts.writer->work();
  const HistoryStatistics statistics = parts.writer->statistics();
  const bool is_whole =
      statistics.commits != parts.commits_seen && statistics.lost == parts.lost_seen;
  if (is_whole && last_cycle >= parts.next_cycle) {
    parts.committed.push_back({parts.grid.start, parts.next_cycle, last_cycle});
    ++parts.commits_all;
  }
  parts.writer.reset();
}

std::uint64_t HistoryDisk::commits() const noexcept {
  return parts_->commits_all;
}

std::string HistoryDisk::verify() {
  Parts& parts = *parts_;
  parts.writer.reset();
  parts.disk = {};
  const std::filesystem::path file = parts.config().file;
  try {
    const HistoryReader reader(file);
    std::map<std::int64_t, std::vector<std::pair<std::uint64_t, std::int64_t>>> held;
    for (const SegmentInfo& segment : reader.segments())
      held[segment.grid.start.count()].emplace_back(segment.first_cycle, segment.last_cycle);
    for (const Committed& span : parts.committed) {
      std::uint64_t next = span.from;
      const auto& left_out = parts.skipped[span.grid_start.count()];
      const auto pass_skipped = [&] {
        while (left_out.contains(next)) ++next;
      };
      pass_skipped();
      for (const auto& [first, last] : held[span.grid_start.count()])
        if (first <= next && last >= static_cast<std::int64_t>(next)) {
          next = static_cast<std::uint64_t>(last) + 1;
          pass_skipped();
        }
      if (next <= span.to)
        return fmt::format("cycle {} (of {}..{}) of the run from {:.0f} s is not in the file{}",
                           next, span.from, span.to,
                           1e-9 * static_cast<double>(span.grid_start.count()), [&] {
                             std::string all;
                             for (const auto& [first, last] : held[span.grid_start.count()])
                               all += fmt::format(" {}..{}", first, last);
                             return all;
                           }());
    }
    const ReplaySummary summary =
        replay(file, {}, {}, [&parts](const SegmentSetup& setup) -> ReplaySetup {
          return parts.setups.at(std::stoul(setup.config_text));
        });
    if (!summary.damage.empty()) return to_string(summary.damage.front());
    if (summary.different != 0)
      return fmt::format("{} of {} offsets come out different, first in cycle {}",
                         summary.different, summary.compared,
                         summary.first_different_cycle.value_or(0));
  } catch (const HistoryError& error) {
    if (parts.committed.empty()) return {};
    return error.what();
  }
  return {};
}

}  // namespace thermocomp::faults
