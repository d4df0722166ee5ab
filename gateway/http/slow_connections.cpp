#include "gateway/http/slow_connections.hpp"

#include <sys/socket.h>

namespace thermocomp::gateway {

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
  for (const auto& [fd, place] : places_) {
    const auto lasts = now - place.since;
    const bool is_slow = (place.stage == Stage::request && lasts > request_max) ||
                         (place.stage == Stage::answer && lasts > answer_max);
    if (is_slow) shutdown(fd, SHUT_RDWR);
  }
}

std::size_t SlowConnections::count() const {
  const std::lock_guard lock(mutex_);
  return places_.size();
}

}  // namespace thermocomp::gateway
