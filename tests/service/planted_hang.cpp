// Preloaded into the installed thermocompd by the service tests: a hang triggered by a file in its
// state folder. A hang happens once and removes the file.
#undef _FORTIFY_SOURCE  // its poll() would be defined here
#include <atomic>
#include <cstdlib>
#include <ctime>
#include <dlfcn.h>
#include <poll.h>
#include <unistd.h>

namespace {

bool asked_for(const char* file) {
  return ::access(file, F_OK) == 0;
}

bool take(const char* file) {
  return asked_for(file) && ::unlink(file) == 0;
}

[[noreturn]] void block() {
  for (;;) ::pause();
}

[[noreturn]] void spin() {
  for (std::atomic<unsigned> turns = 0;;) ++turns;
}

template <class Function>
Function next(const char* name) {
  auto* found = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
  if (found == nullptr) std::abort();
  return found;
}

}  // namespace

extern "C" {

// The cycle's sleep to the next cycle; no other thread of the daemon sleeps to an absolute time.
int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  static const auto real = next<decltype(&clock_nanosleep)>("clock_nanosleep");
  if (clock == CLOCK_MONOTONIC && (flags & TIMER_ABSTIME) != 0) {
    if (take("/var/lib/thermocomp/plant-cycle-blocks")) block();
    if (take("/var/lib/thermocomp/plant-cycle-spins")) spin();
    while (asked_for("/var/lib/thermocomp/plant-slow-start")) ::usleep(10000);
  }
  return real(clock, flags, time, left);
}

int poll(pollfd* files, nfds_t count, int timeout_ms) {
  static const auto real = next<decltype(&poll)>("poll");
  if (::gettid() == ::getpid() && take("/var/lib/thermocomp/plant-main-blocks")) block();
  return real(files, count, timeout_ms);
}

}  // extern "C"
