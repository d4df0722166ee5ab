#include "fleet/uplink/uplink.hpp"

#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "daemon/history/reading/history_reader.hpp"

namespace thermocomp::fleet {
namespace {

constexpr std::size_t rows_a_batch = 500;
constexpr std::int64_t events_a_batch = 200;

double process_time_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

void Pace::sleep(std::chrono::duration<double> time) const {
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(time);
  const auto rest = std::chrono::duration_cast<std::chrono::nanoseconds>(time - whole);
  const timespec span{whole.count(), rest.count()};
  if (sigtimedwait(&ending_, nullptr, &span) > 0) throw Stopped{};
}

void Pace::rest() {
  const double worked_s = process_time_s() - rested_at_s_;
  if (worked_s < work_s_max) return;
  sleep(std::chrono::duration<double>(worked_s * rest_per_work_));
  rested_at_s_ = process_time_s();
}

Uplink::Uplink(const UplinkSettings& settings, Pace& pace) : settings_(settings), pace_(pace) {
  for (const std::filesystem::path& file : settings.history) sources_.emplace_back().file = file;
}

void Uplink::hang_up() noexcept {
  for (Source& source : sources_) {
    source.means.reset();
    source.rows.reset();
  }
  store_.reset();
}

bool Uplink::send_new() {
  if (!store_) {
    store_.emplace(settings_.store);
    spdlog::info("connected to {}",
                 store_->hostname() != nullptr ? store_->hostname() : "a socket");
  }
  bool is_new = false;
  for (Source& source : sources_) is_new |= send_if_readable(source);
  exchange();
  return is_new;
}

bool Uplink::all_readable() const noexcept {
  return std::all_of(sources_.begin(), sources_.end(),
                     [](const Source& source) { return source.error.empty(); });
}

bool Uplink::send_if_readable(Source& source) {
  try {
    const bool is_new = send_new(source);
    if (!source.error.empty()) spdlog::info("{}: sending again", source.file.string());
    source.error.clear();
    return is_new;
  } catch (const HistoryError& error) {
    if (source.error != error.what()) spdlog::warn("not sent: {}", error.what());
    source.error = error.what();
    source.means.reset();
    if (source.rows) source.rows->greet(1);
    return false;
  }
}

/// Problems with a release do not stop the uplink.
void Uplink::exchange() {
  try {
    exchange_releases(*store_, settings_.releases);
    reported_error_.clear();
  } catch (const pqxx::broken_connection&) {
    throw;
  } catch (const std::exception& error) {
    if (reported_error_ != error.what()) spdlog::warn("releases: {}", error.what());
    reported_error_ = error.what();
  }
}

bool Uplink::send_new(Source& source) {
  if (!source.rows) source.rows.emplace(*store_, "", source.file.string());
  if (!source.means) {
    const Progress progress = source.rows->progress();
    source.means.emplace(source.file, progress.position);
    const bool is_same_file = source.means->is_continued();
    source.event_run = is_same_file ? progress.event_run : 0;
    source.event_number = is_same_file ? progress.event_number : 0;
    if (!is_same_file) spdlog::info("{}: from its beginning", source.file.string());
  }
  bool is_new = send_events(source);
  const auto rest = [this] { pace_.rest(); };
  while (std::optional<MeansBatch> batch =
             source.means->next(rows_a_batch, std::time(nullptr), rest)) {
    const Taken taken = source.rows->send(*batch);
    is_new = true;
    if (taken.refused > 0)
      spdlog::warn("{} of {} rows refused: their time is impossible (clock set wrong?)",
                   taken.refused, taken.sent);
    if (taken.by_another && !std::exchange(source.by_another, true))
      spdlog::warn(
          "another uplink sends {} as this machine, too: a second one on this computer, or one "
          "with this machine's role (each machine needs its own: thermocomp-fleet add)",
          source.file.string());
    if (taken.repeated > 0)
      spdlog::info("{} of {} rows were already present", taken.repeated, taken.sent);
    pace_.rest();
    if (batch->rows.size() < rows_a_batch) break;
  }
  source.rows->greet(source.means->damaged());
  return is_new;
}

bool Uplink::send_events(Source& source) {
  bool is_new = false;
  for (;;) {
    const std::vector<RecordedEvent> events =
        read_events_after(source.file, source.event_run, source.event_number, events_a_batch);
    if (events.empty()) return is_new;
    source.rows->send(events);
    source.event_run = events.back().run;
    source.event_number = events.back().number;
    is_new = true;
    pace_.rest();
  }
}

}  // namespace thermocomp::fleet
