// Preloaded into the daemon by attacks_daemon.py: falsifies the wall clock and fails sleeps, as
// given in the file THERMOCOMP_CLOCKS. It holds two 64-bit numbers: nanoseconds added to
// CLOCK_REALTIME, and a flag for failing sleeps.

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <sys/mman.h>
#include <sys/time.h>

namespace {

struct Wanted {
  volatile std::int64_t wall_ns;
  volatile std::int64_t sleeps_fail;
};

const Wanted& wanted() {
  static const Wanted* const shared = [] {
    const char* path = std::getenv("THERMOCOMP_CLOCKS");
    const int file = path != nullptr ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    void* place = mmap(nullptr, sizeof(Wanted), PROT_READ, MAP_SHARED, file, 0);
    if (place == MAP_FAILED) _exit(125);
    return static_cast<const Wanted*>(place);
  }();
  return *shared;
}

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static const auto ask = real<int(clockid_t, timespec*)>("clock_gettime");
  const int result = ask(clock, time);
  if (result != 0 || clock != CLOCK_REALTIME) return result;
  constexpr std::int64_t second = 1000000000;
  const std::int64_t wall = time->tv_sec * second + time->tv_nsec + wanted().wall_ns;
  time->tv_sec = wall / second;
  time->tv_nsec = wall % second;
  return 0;
}

int gettimeofday(timeval* time, void*) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* seconds) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (seconds != nullptr) *seconds = now.tv_sec;
  return now.tv_sec;
}

int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  static const auto sleep =
      real<int(clockid_t, int, const timespec*, timespec*)>("clock_nanosleep");
  if (wanted().sleeps_fail != 0 && (flags & TIMER_ABSTIME) != 0) return EINVAL;
  return sleep(clock, flags, time, left);
}
}
