#include "gateway/http/slow_connections.hpp"

#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

namespace thermocomp::gateway {
namespace {

/// Of a stream that is read, so much may be on its way: some seconds of changes.
constexpr std::size_t under_way_bytes_max = 512;

/// Bytes that were sent and that the other side has not taken.
std::size_t untaken_bytes(int fd) {
  int bytes = 0;
  return ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::size_t>(bytes) : 0;
}

}  // namespace

void SlowConnections::opened(int fd, Clock::time_point now) {
  is_at(fd, Stage::request, now);
}

void SlowConnections::is_at(int fd, Stage stage, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  places_[fd] = {stage, now};
}

void SlowConnections::closed(int fd) {
  const std::lock_guard lock(mutex_);
  places_.erase(fd);
}

void SlowConnections::end_slow(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  const bool is_full = places_.size() >= places_max_;
  const auto request_lasts_max = is_full ? request_max_when_full : request_max;
  const auto answer_lasts_max = is_full ? answer_max_when_full : answer_max;
  for (auto& [fd, place] : places_) {
    const bool is_stream = place.stage == Stage::stream;
    if (is_stream && untaken_bytes(fd) <= under_way_bytes_max) place.since = now;
    const auto lasts = now - place.since;
    const bool is_slow = (place.stage == Stage::request && lasts > request_lasts_max) ||
                         (place.stage != Stage::request && lasts > answer_lasts_max) ||
                         (is_stream && untaken_bytes(fd) > untaken_bytes_max);
    if (is_slow) shutdown(fd, SHUT_RDWR);
  }
}

std::size_t SlowConnections::count() const {
  const std::lock_guard lock(mutex_);
  return places_.size();
}

}  // namespace thermocomp::gateway
