// SPDX-License-Identifier: GPL-2.0-or-later thermocomp-linuxcnc: bridge between HAL and the
// daemon's socket.
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include <sys/random.h>
#include <sys/signalfd.h>

#include "linuxcnc/command_line.hpp"
#include "linuxcnc/daemon_link.hpp"
#include "linuxcnc/hal_pins.hpp"

namespace thermocomp_linuxcnc {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto reconnect_after = 500ms;
/// Longest time for an answer: the daemon executes a command first.
constexpr auto answer_max = 10s;
constexpr auto offsets_cleared_within = 300ms;

int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT}) sigaddset(&set, signal);
  sigprocmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

/// A new number per connection, which marks a client that asks again after a break as new.
std::uint64_t new_session() {
  std::uint32_t number = 0;
  while (number == 0)
    if (getrandom(&number, sizeof number, 0) != static_cast<ssize_t>(sizeof number)) number = 0;
  return number;
}

/// After power-on and homing, LinuxCNC clears an external offset some servo periods late. Until
/// then the applied offset is an old one and is not reported as taken.
class Settled {
 public:
  bool taking(bool taking, Clock::time_point now) {
    if (taking && !was_taking_) since_ = now;
    was_taking_ = taking;
    return taking && now - since_ >= offsets_cleared_within;
  }

 private:
  bool was_taking_{false};
  Clock::time_point since_{};
};

class Exchange {
 public:
  Exchange(const BridgeOptions& options, BridgeState& state)
      : options_(options), state_(state), link_(options.socket) {}

  /// Connects when due, and sends a request unless an answer is pending.
  void ask(const MachineView& view, Clock::time_point now) {
    if (asked_ && now - asked_at_ > answer_max) {
      link_.close();
      print_once("the daemon does not answer");
    }
    if (!link_.connected()) connect(now);
    if (!link_.connected() || asked_) return;
    reported_ = view;
    if (!link_.send(request_line(session_, ++id_, options_.axes, view))) {
      print_once(link_.error());
      return;
    }
    asked_ = true;
    asked_at_ = now;
  }

  void listen() {
    while (const std::optional<std::string> line = link_.receive()) {
      const bool awaited = std::exchange(asked_, false);
      try {
        if (!awaited) throw BadAnswer("unrequested answer from the daemon");
        const Answer answer = read_answer(*line, id_, options_.axes, options_.limits.offset_mm_max);
        state_.take(answer, reported_, Clock::now().time_since_epoch());
        print_once("");
      } catch (const BadAnswer& error) {
        state_.fault();
        print_once(error.what());
      }
    }
    if (!link_.connected() && !link_.error().empty()) print_once(link_.error());
  }

  [[nodiscard]] int fd() const { return link_.fd(); }
  [[nodiscard]] bool connected() const { return link_.connected(); }

 private:
  void connect(Clock::time_point now) {
    asked_ = false;
    if (now < connect_next_) return;
    connect_next_ = now + reconnect_after;
    session_ = new_session();
    if (!link_.connect()) print_once(link_.error());
  }

  /// Prints each new message once; empty: no problem.
  void print_once(const std::string& what) {
    if (what == last_printed_) return;
    last_printed_ = what;
    std::fprintf(stderr, "thermocomp-linuxcnc: %s\n",
                 what.empty() ? "in exchange with the daemon" : what.c_str());
  }

  const BridgeOptions& options_;
  BridgeState& state_;
  DaemonLink link_;
  MachineView reported_;
  std::uint64_t session_{0};
  std::uint64_t id_{0};
  bool asked_{false};
  Clock::time_point asked_at_{};
  Clock::time_point connect_next_{};
  std::string last_printed_;
};

/// Runs until SIGTERM or SIGINT. @throws HalError at the start
void run_bridge(const BridgeOptions& options) {
  const int signals = open_signals();
  HalPins pins(options.name, options.axes, unit_mm(options.unit));
  BridgeState state(options.axes.size(), options.limits);
  Exchange exchange(options, state);
  Settled settled;
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.period_s));
  const auto view = [&](Clock::time_point now) {
    MachineView seen = pins.read();
    seen.taking = settled.taking(seen.taking, now);
    return seen;
  };
  Clock::time_point next = Clock::now();
  for (;;) {
    const Clock::time_point now = Clock::now();
    if (now >= next) {
      next = std::max(next + period, now);
      exchange.ask(view(now), now);
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
    pollfd files[] = {{signals, POLLIN, 0}, {exchange.fd(), POLLIN, 0}};
    poll(files, 2, static_cast<int>(std::max<std::int64_t>(left, 0)));
    if ((files[0].revents & POLLIN) != 0) break;
    if (exchange.connected()) exchange.listen();
    const Clock::time_point shown_at = Clock::now();
    pins.write(state.show(view(shown_at), shown_at.time_since_epoch()), exchange.connected());
  }
  close(signals);
}

}  // namespace
}  // namespace thermocomp_linuxcnc

int main(int argc, char** argv) {
  using namespace thermocomp_linuxcnc;
  int status = 0;
  try {
    const auto task = read_command_line(argc, argv, status);
    if (!task) return status;
    if (!task->print_hal)
      run_bridge(task->bridge);
    else
      std::cout << (task->rejoin_as.empty() ? hal_file(task->hal)
                                            : rejoin_file(task->hal, task->rejoin_as));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp-linuxcnc: %s\n", error.what());
    return 2;
  }
}
