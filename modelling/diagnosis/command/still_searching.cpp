#include "modelling/diagnosis/command/still_searching.hpp"

#include <array>
#include <cerrno>
#include <string_view>
#include <unistd.h>

#include <sys/time.h>

namespace thermocomp::diagnosis {
namespace {

constexpr int first_line_s = 2;
constexpr int next_lines_s = 10;

volatile std::sig_atomic_t so_far_s = 0;

/// Only what a signal handler may do: write(), and no stream.
void tell(int) {
  const int kept = errno;
  std::array<char, 120> line{};
  std::size_t length = 0;
  const auto append = [&](std::string_view text) {
    for (const char each : text) line[length++] = each;
  };
  append("thermocomp: searching what the model gets wrong, ");
  const int seconds = so_far_s;
  int digit = 1;
  while (seconds / digit >= 10) digit *= 10;
  for (; digit > 0; digit /= 10) line[length++] = static_cast<char>('0' + seconds / digit % 10);
  append(" s so far\n");
  if (::write(STDERR_FILENO, line.data(), length) < 0) {
    // nobody reads; the search goes on
  }
  so_far_s = seconds + next_lines_s;
  errno = kept;
}

}  // namespace

StillSearching::StillSearching() {
  so_far_s = first_line_s;
  struct sigaction on_alarm {};
  on_alarm.sa_handler = tell;
  on_alarm.sa_flags = SA_RESTART;
  ::sigaction(SIGALRM, &on_alarm, &before_);
  const itimerval times{{next_lines_s, 0}, {first_line_s, 0}};
  ::setitimer(ITIMER_REAL, &times, nullptr);
}

StillSearching::~StillSearching() {
  const itimerval never{};
  ::setitimer(ITIMER_REAL, &never, nullptr);
  ::sigaction(SIGALRM, &before_, nullptr);
}

}  // namespace thermocomp::diagnosis
