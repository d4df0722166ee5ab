#include "simulator/devices/event_loop.hpp"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <poll.h>
#include <utility>
#include <vector>

#include <system_error>

#include "estimator/checks.hpp"

namespace thermocomp {

nanoseconds EventLoop::now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

void EventLoop::watch(int file, short events, Ready ready) {
  watches_.insert_or_assign(file, Watch{++tokens_, events, std::move(ready)});
}

void EventLoop::change(int file, short events) {
  const auto found = watches_.find(file);
  THERMOCOMP_ENSURE(found != watches_.end());
  found->second.events = events;
}

void EventLoop::unwatch(int file) {
  watches_.erase(file);
}

void EventLoop::at(nanoseconds when, Wake wake) {
  wakes_.emplace(when, std::move(wake));
}

void EventLoop::run() {
  running_ = true;
  while (running_) {
    wake_due();
    if (running_) wait_and_dispatch();
  }
}

void EventLoop::wake_due() {
  const nanoseconds present = now();
  while (running_ && !wakes_.empty() && wakes_.begin()->first <= present) {
    const Wake wake = std::move(wakes_.begin()->second);
    wakes_.erase(wakes_.begin());
    wake();
  }
}

void EventLoop::wait_and_dispatch() {
  std::vector<pollfd> files;
  std::vector<std::uint64_t> tokens;
  for (const auto& [file, watch] : watches_) {
    files.push_back({file, watch.events, 0});
    tokens.push_back(watch.token);
  }
  timespec limit{};
  if (!wakes_.empty()) {
    const nanoseconds left = std::max(nanoseconds{0}, wakes_.begin()->first - now());
    limit.tv_sec = static_cast<std::time_t>(left.count() / 1'000'000'000);
    limit.tv_nsec = static_cast<long>(left.count() % 1'000'000'000);
  }
  const int count = ::ppoll(files.data(), files.size(), wakes_.empty() ? nullptr : &limit, nullptr);
  if (count < 0 && errno != EINTR) {
    throw std::system_error(errno, std::generic_category(), "ppoll");
  }
  if (count <= 0) return;
  for (std::size_t i = 0; i < files.size() && running_; ++i) {
    if (files[i].revents == 0) continue;
    const auto found = watches_.find(files[i].fd);
    if (found == watches_.end() || found->second.token != tokens[i]) continue;
    const Ready ready = found->second.ready;  // copied, since it may unwatch itself
    ready(files[i].revents);
  }
}

}  // namespace thermocomp
