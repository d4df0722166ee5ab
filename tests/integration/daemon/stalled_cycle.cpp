// Preloaded into thermocompd by tests: while the file named by THERMOCOMP_STALL exists, the cycle's
// sleep to the next cycle does not end. All other threads continue.
#undef _FORTIFY_SOURCE
#include <cstdlib>
#include <ctime>
#include <dlfcn.h>
#include <unistd.h>

extern "C" int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  static const auto real =
      reinterpret_cast<decltype(&clock_nanosleep)>(::dlsym(RTLD_NEXT, "clock_nanosleep"));
  if (real == nullptr) std::abort();
  // No other thread of the daemon sleeps to an absolute time.
  if (clock == CLOCK_MONOTONIC && (flags & TIMER_ABSTIME) != 0) {
    const char* file = std::getenv("THERMOCOMP_STALL");
    const timespec pause{0, 5'000'000};
    while (file != nullptr && ::access(file, F_OK) == 0) real(CLOCK_MONOTONIC, 0, &pause, nullptr);
  }
  return real(clock, flags, time, left);
}
