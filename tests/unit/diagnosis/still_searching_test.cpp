// The line that tells that a search goes on.
#include "modelling/diagnosis/command/still_searching.hpp"

#include <array>
#include <csignal>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/time.h>

using thermocomp::diagnosis::StillSearching;

namespace {

/// What `action` writes to stderr.
template <class Action>
std::string on_stderr(const Action& action) {
  std::array<int, 2> ends{};
  REQUIRE(::pipe(ends.data()) == 0);
  const int before = ::dup(STDERR_FILENO);
  ::dup2(ends[1], STDERR_FILENO);
  ::close(ends[1]);
  action();
  ::dup2(before, STDERR_FILENO);  // the pipe's last writer is gone
  ::close(before);
  std::string text;
  std::array<char, 256> part{};
  for (ssize_t got = 0; (got = ::read(ends[0], part.data(), part.size())) > 0;)
    text.append(part.data(), static_cast<std::size_t>(got));
  ::close(ends[0]);
  return text;
}

}  // namespace

TEST_CASE("a search that goes on is told with its seconds: 2, 12, 22", "[diagnosis]") {
  const std::string told = on_stderr([] {
    const StillSearching still_searching;
    for (int i = 0; i < 3; ++i) std::raise(SIGALRM);
  });
  const std::string line = "thermocomp: searching what the model gets wrong, ";
  const std::string three = line + "2 s so far\n" + line + "12 s so far\n" + line + "22 s so far\n";
  CHECK(told.substr(0, three.size()) == three);  // a slow machine adds one of its own
}

TEST_CASE("a line is due every ten seconds", "[diagnosis]") {
  const StillSearching still_searching;
  itimerval times{};
  REQUIRE(::getitimer(ITIMER_REAL, &times) == 0);
  CHECK((times.it_value.tv_sec > 0 || times.it_value.tv_usec > 0));
  CHECK(times.it_interval.tv_sec == 10);
}

TEST_CASE("a search that has ended leaves no alarm", "[diagnosis]") {
  struct sigaction ignored {};
  ignored.sa_handler = SIG_IGN;
  struct sigaction first {};
  ::sigaction(SIGALRM, &ignored, &first);
  { const StillSearching still_searching; }
  itimerval times{};
  REQUIRE(::getitimer(ITIMER_REAL, &times) == 0);
  CHECK((times.it_value.tv_sec == 0 && times.it_value.tv_usec == 0));
  struct sigaction after {};
  ::sigaction(SIGALRM, &first, &after);
  CHECK(after.sa_handler == SIG_IGN);
}
