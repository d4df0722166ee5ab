#include "daemon/history/writing/history_writer.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <iterator>
#include <mutex>
#include <optional>
#include <pthread.h>
#include <time.h>
#include <vector>

#include <sys/statvfs.h>

#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/writing/history_store.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds drain_period{50};
/// The documented guarantee is a commit every 10 s; the rest is for the commit itself.
constexpr double commit_s_max = 9.5;
constexpr std::size_t chunk_bytes_max = std::size_t{512} * 1024;
constexpr double backoff_s_max = 60.0;
/// A client that polls every second cannot miss more.
constexpr std::ptrdiff_t messages_max = 100;
/// SQLite needs little; the default of 8 MB would be locked completely.
constexpr std::size_t stack_bytes = std::size_t{512} * 1024;

/// SQLite reports a full disk at open as an I/O error: adds the cause.
std::string disk_note(const std::filesystem::path& file) {
  constexpr std::uint64_t room_bytes_min = std::uint64_t{256} * 1024;
  struct statvfs disk {};
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  if (statvfs(folder.c_str(), &disk) != 0) return {};
  const std::uint64_t room_bytes = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  return room_bytes < room_bytes_min ? " (its disk is full)" : "";
}

/// The segment being recorded.
struct OpenSegment {
  std::int64_t token{0};
  std::uint64_t first_cycle{0};
  std::int64_t through_cycle{-1};  ///< last complete cycle
  std::int64_t chunk_through{-1};  ///< ... at the last chunk
  std::int64_t next_chunk{0};
  std::uint64_t bytes{0};
  std::int64_t wall_minus_monotonic_ns{0};  ///< at its begin
  ChunkEncoder encoder;
};

/// Smaller clock steps do not matter in any report.
constexpr std::int64_t clock_set_ns = 30'000'000'000;

struct KnownSession {
  std::shared_ptr<RecordingSession> session;
  std::shared_ptr<const SegmentSetup> setup;
};

}  // namespace

struct HistoryWriter::Parts {
  HistoryConfig config;
  Grid grid;
  std::string program_version;
  WriterClocks clocks;
  RecordRing ring;

  // Shared between threads.
  mutable std::mutex mutex;
  std::condition_variable wake;
  bool stopping{false};
  std::vector<KnownSession> sessions;
  std::vector<Event> events;  ///< not yet committed
  std::uint16_t next_session{1};
  HistoryStatistics statistics;
  std::vector<std::string> messages;
  std::optional<nanoseconds> last_commit;

  // The writer's thread only (and start() before it runs).
  HistoryStore store;
  pthread_t thread{};
  bool running{false};
  std::array<Record, 1024> batch{};
  PendingRows pending;
  std::optional<OpenSegment> segment;  ///< target of records; none: they are dropped
  KnownSession segment_session;
  std::int64_t next_token{1};
  std::uint64_t dropped{0};
  bool lost_before{false};  ///< the next segment begins after a gap
  bool requested{false};    ///< a snapshot is pending
  double backoff_s{0.0};
  nanoseconds next_commit{};

  Parts(const HistoryConfig& config_in, const Grid& grid_in, std::string version,
        std::size_t ring_records, WriterClocks clocks_in)
      : config(config_in),
        grid(grid_in),
        program_version(std::move(version)),
        clocks(std::move(clocks_in)),
        ring(ring_records),
        store(config_in, clocks.wall) {}

  void run();
  void work();
  [[nodiscard]] std::int64_t wall_minus_monotonic_ns() const {
    return (clocks.wall() - clocks.monotonic()).count();
  }
  void drain();
  void take(const Record& record);
  void begin_segment(const Record& record);
  void close_segment(std::int64_t last_whole_cycle);
  void cut_chunk();
  void take_events();
  void commit();
  bool write();
  void take_from_store();
  [[nodiscard]] bool is_working() const;
  void written(std::uint64_t records);
  void failed(const std::string& why);
  void drop_pending();
  void request(SegmentReason reason);
  void request_if_due();
  [[nodiscard]] KnownSession find_session(std::uint16_t id);
};

void HistoryWriter::Parts::run() {
  std::unique_lock lock(mutex);
  while (!stopping) {
    wake.wait_for(lock, drain_period, [this] { return stopping; });
    lock.unlock();
    work();
    lock.lock();
  }
  lock.unlock();
  drain();
  commit();
  store.close();
}

void HistoryWriter::Parts::work() {
  drain();
  if (clocks.monotonic() >= next_commit) commit();
}

void HistoryWriter::Parts::drain() {
  while (const std::size_t count = ring.pop(batch)) {
    for (std::size_t i = 0; i < count; ++i) take(batch[i]);
    if (segment && segment->encoder.size_bytes() > chunk_bytes_max) cut_chunk();
    if (pending.bytes() > memory_bytes_max) drop_pending();
  }
}

void HistoryWriter::Parts::take(const Record& record) {
  if (record.kind == RecordKind::segment_begin) {
    begin_segment(record);
  } else if (!segment) {
    ++dropped;
  } else if (record.kind == RecordKind::cycle_done) {
    segment->through_cycle = static_cast<std::int64_t>(record.cycle);
  } else {
    segment->encoder.add(record);
  }
}

void HistoryWriter::Parts::begin_segment(const Record& record) {
  close_segment(record.time_ns);
  const KnownSession known = find_session(record.session);
  THERMOCOMP_ENSURE(known.session != nullptr && record.index < known.session->snapshots.size());
  Snapshot& snapshot = known.session->snapshots[record.index];
  auto reason = static_cast<SegmentReason>(record.detail);
  if (lost_before && reason != SegmentReason::start) reason = SegmentReason::gap;

  SegmentRow row;
  row.token = next_token++;
  row.setup = known.setup;
  row.reason = reason;
  row.grid = grid;
  row.first_cycle = record.cycle;
  row.wall_ns = grid.time_of(record.cycle).count() + wall_minus_monotonic_ns();
  row.program_version = program_version;
  row.estimator_state = snapshot.estimator_state;
  add_seal(row.estimator_state);
  row.inputs = encode_inputs(snapshot.readings, snapshot.controller);
  snapshot.taken.store(false, std::memory_order_release);

  segment.emplace();
  segment->wall_minus_monotonic_ns = wall_minus_monotonic_ns();
  segment->token = row.token;
  segment->first_cycle = row.first_cycle;
  segment->through_cycle = static_cast<std::int64_t>(row.first_cycle) - 1;
  segment->chunk_through = segment->through_cycle;
  segment_session = known;
  pending.add(std::move(row));
  requested = false;
  lost_before = false;
  const std::lock_guard lock(mutex);
  if (reason == SegmentReason::gap) ++statistics.gaps;
  std::erase_if(sessions, [&](const KnownSession& old) {
    // Older sessions only (numbers wrap around): a newer one's first segment may be in the ring.
    return static_cast<std::int16_t>(old.session->id - known.session->id) < 0 &&
           old.session.use_count() == 1;
  });
}

void HistoryWriter::Parts::close_segment(std::int64_t last_whole_cycle) {
  if (!segment) return;
  segment->through_cycle = std::max(segment->through_cycle, last_whole_cycle);
  cut_chunk();
  segment.reset();
}

/// Makes a chunk of the records since the last one, even without records, since it marks cycles
/// without changes as complete.
void HistoryWriter::Parts::cut_chunk() {
  if (!segment) return;
  if (segment->encoder.count() == 0 && segment->through_cycle == segment->chunk_through) return;
  const auto count = static_cast<std::int64_t>(segment->encoder.count());
  ChunkRow row{{segment->next_chunk++, count, segment->through_cycle, wall_minus_monotonic_ns(),
                segment->encoder.take()},
               segment->token};
  segment->chunk_through = segment->through_cycle;
  segment->bytes += row.records.size();
  pending.add(std::move(row));
}

void HistoryWriter::Parts::take_events() {
  std::vector<Event> taken;
  {
    const std::lock_guard lock(mutex);
    taken.swap(events);
  }
  for (Event& event : taken) pending.add(std::move(event));
}

void HistoryWriter::Parts::commit() {
  cut_chunk();
  take_events();
  if (write()) {
    backoff_s = 0.0;
    next_commit = clocks.monotonic() + to_nanoseconds(std::min(config.commit_s, commit_s_max));
    request_if_due();
  } else {
    backoff_s = std::clamp(2.0 * backoff_s, 0.5, backoff_s_max);
    next_commit = clocks.monotonic() + to_nanoseconds(backoff_s);
  }
}

bool HistoryWriter::Parts::write() {
  try {
    const bool is_in_file = segment && !pending.begins(segment->token);
    if (!store.open_if_closed(is_in_file ? segment->token : 0)) {
      // The file was replaced: rows of a segment in the old one cannot be stored.
      drop_pending();
    }
    store.write(pending, !is_working());
    written(pending.records());
    store.keep_within_bounds(segment ? segment->token : 0);
  } catch (const DatabaseError& error) {
    if (error.is_damage()) store.move_aside(error.what());
    // Stays open on a full disk, since reopening would need space.
    if (error.is_temporary())
      store.note_files();
    else
      store.close();
    failed(error.what());
    return false;
  } catch (const std::exception& error) {
    store.close();
    failed(error.what());
    return false;
  }
  take_from_store();
  return true;
}

void HistoryWriter::Parts::take_from_store() {
  std::vector<std::string> fresh = store.take_messages();
  const std::lock_guard lock(mutex);
  std::move(fresh.begin(), fresh.end(), std::back_inserter(messages));
  if (std::ssize(messages) > messages_max)
    messages.erase(messages.begin(), messages.end() - messages_max);
  statistics.segments = store.segments();
  statistics.bytes = store.bytes();
  statistics.deleted = store.deleted();
  statistics.replaced = store.replaced();
}

bool HistoryWriter::Parts::is_working() const {
  const std::lock_guard lock(mutex);
  return statistics.working;
}

/// The rows are on disk and must not be written again, even if something fails afterwards.
void HistoryWriter::Parts::written(std::uint64_t records) {
  pending.clear();
  const std::lock_guard lock(mutex);
  statistics.working = true;
  statistics.last_error.clear();
  statistics.records += records;
  ++statistics.commits;
  statistics.lost = ring.lost() + dropped;
  last_commit = clocks.monotonic();
}

void HistoryWriter::Parts::failed(const std::string& why) {
  take_from_store();
  const std::lock_guard lock(mutex);
  statistics.working = false;
  statistics.last_error = why + disk_note(config.file);
  ++statistics.errors;
  statistics.lost = ring.lost() + dropped;
}

void HistoryWriter::Parts::drop_pending() {
  dropped += pending.records() + (segment ? segment->encoder.count() : 0);
  pending.clear();
  segment.reset();
  requested = false;
  lost_before = true;
}

void HistoryWriter::Parts::request(SegmentReason reason) {
  if (requested || segment_session.session == nullptr) return;
  segment_session.session->requested.store(static_cast<std::uint8_t>(static_cast<int>(reason) + 1),
                                           std::memory_order_relaxed);
  requested = true;
}

void HistoryWriter::Parts::request_if_due() {
  if (!segment) {
    request(SegmentReason::gap);
    return;
  }
  const auto cycles = segment->through_cycle - static_cast<std::int64_t>(segment->first_cycle) + 1;
  const bool old = grid.period * cycles >= to_nanoseconds(config.segment_h * 3600.0);
  const bool large = static_cast<double>(segment->bytes) > config.size_MB_max * 1e6 / 8.0;
  // A segment has the wall time of its begin, so a clock set later needs a new one.
  const std::int64_t set_by_ns = wall_minus_monotonic_ns() - segment->wall_minus_monotonic_ns;
  const bool was_set = std::abs(set_by_ns) > clock_set_ns && is_wall_time(clocks.wall().count());
  if (old || large || was_set) request(SegmentReason::periodic);
}

KnownSession HistoryWriter::Parts::find_session(std::uint16_t id) {
  const std::lock_guard lock(mutex);
  for (const KnownSession& known : sessions) {
    if (known.session->id == id) return known;
  }
  return {};
}

HistoryWriter::HistoryWriter(const HistoryConfig& config, const Grid& grid,
                             std::string program_version, std::size_t ring_records,
                             WriterClocks clocks)
    : parts_(std::make_unique<Parts>(config, grid, std::move(program_version), ring_records,
                                     std::move(clocks))) {}

HistoryWriter::~HistoryWriter() {
  stop();
}

std::unique_ptr<CycleRecorder> HistoryWriter::make_recorder(const SegmentSetup& setup,
                                                            const Estimator& estimator) {
  auto session = std::make_shared<RecordingSession>();
  {
    const std::lock_guard lock(parts_->mutex);
    session->id = parts_->next_session++;
    parts_->sessions.push_back({session, std::make_shared<const SegmentSetup>(setup)});
  }
  return std::make_unique<CycleRecorder>(parts_->ring, std::move(session), parts_->grid,
                                         to_nanoseconds(parts_->config.offsets_period_s),
                                         estimator);
}

void HistoryWriter::note(Event event) {
  const std::lock_guard lock(parts_->mutex);
  parts_->events.push_back(std::move(event));
}

WriterClocks system_clocks() {
  return {[] { return std::chrono::steady_clock::now().time_since_epoch(); },
          [] { return std::chrono::system_clock::now().time_since_epoch(); }};
}

void HistoryWriter::open() {
  try {
    static_cast<void>(parts_->store.open_if_closed(0));
  } catch (const DatabaseError& error) {
    // The thread retries. After any other HistoryError this file must not be written.
    if (error.is_damage()) parts_->store.move_aside(error.what());
    parts_->store.close();
    parts_->failed(error.what());
  }
}

void HistoryWriter::work() {
  parts_->work();
}

void HistoryWriter::start() {
  THERMOCOMP_ENSURE(!parts_->running);
  open();
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_bytes);
  const int code = pthread_create(
      &parts_->thread, &attributes,
      [](void* parts) -> void* {
        pthread_setname_np(pthread_self(), "history");
        static_cast<Parts*>(parts)->run();
        return nullptr;
      },
      parts_.get());
  pthread_attr_destroy(&attributes);
  if (code != 0) throw HistoryError("the history's thread could not be started");
  parts_->running = true;
}

void HistoryWriter::stop() noexcept {
  if (!parts_->running) return;
  ask_to_stop();
  pthread_join(parts_->thread, nullptr);
  parts_->running = false;
}

bool HistoryWriter::stop_within(std::chrono::seconds at_most) noexcept {
  if (!parts_->running) return true;
  ask_to_stop();
  timespec until{};
  clock_gettime(CLOCK_MONOTONIC, &until);
  until.tv_sec += at_most.count();
  if (pthread_clockjoin_np(parts_->thread, nullptr, CLOCK_MONOTONIC, &until) != 0) return false;
  parts_->running = false;
  return true;
}

void HistoryWriter::ask_to_stop() noexcept {
  {
    const std::lock_guard lock(parts_->mutex);
    parts_->stopping = true;
  }
  parts_->wake.notify_all();
}

std::vector<std::string> HistoryWriter::take_messages() {
  const std::lock_guard lock(parts_->mutex);
  return std::exchange(parts_->messages, {});
}

HistoryStatistics HistoryWriter::statistics() const {
  const std::lock_guard lock(parts_->mutex);
  HistoryStatistics copy = parts_->statistics;
  if (parts_->last_commit) {
    copy.last_commit_age_s =
        std::chrono::duration<double>(parts_->clocks.monotonic() - *parts_->last_commit).count();
  }
  return copy;
}

}  // namespace thermocomp
