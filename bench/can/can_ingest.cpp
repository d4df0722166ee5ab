// A full CAN bus of 1 Mbit/s received and decoded by our source, compared with candump (can-utils)
// writing the same load to /dev/null. Needs vcan0; run by bench/can/can_ingest.sh.
//
// Load: data frames of 8 bytes with 11-bit identifiers back to back, without stuff bits, the
// maximum of 1 Mbit/s (111 bits each), on 16 identifiers; four signals of 16 bits per frame, two of
// them Motorola, all decoded. Each receiver is a process; user and system times from fork to end
// are compared, in interleaved rounds.
//
//   bench_can_ingest [ROUNDS [SECONDS]]      default: 5 rounds of 5 s each
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <stdexcept>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include "drivers/sensors/can_source.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

constexpr const char* interface = "vcan0";
constexpr int identifiers = 16;
constexpr std::uint32_t first_id = 0x181;
constexpr double bits_per_s = 1e6;
constexpr double bits_per_frame = 111.0;

struct Received {
  std::uint64_t good{0};
  std::uint64_t dropped{0};
};

struct Cost {
  double cpu_s{0.0};
  std::uint64_t sent{0};
  Received received;
};

void expect(bool good, const char* what) {
  if (!good) throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
}

CanBusConfig every_signal() {
  CanBusConfig bus;
  bus.name = "bench";
  bus.interface = interface;
  for (int i = 0; i < identifiers; ++i) {
    CanDeviceConfig& device = bus.devices.emplace_back();
    device.name = "node" + std::to_string(i);
    for (int place = 0; place < 4; ++place) {
      CanChannel& channel = device.channels.emplace_back();
      channel.sensor = 4 * static_cast<std::size_t>(i) + static_cast<std::size_t>(place);
      channel.signal.id = first_id + static_cast<std::uint32_t>(i);
      channel.signal.byte_order = place % 2 == 0 ? ByteOrder::little_endian : ByteOrder::big_endian;
      channel.signal.start_bit = 16 * place + (place % 2 == 0 ? 0 : 7);
      channel.signal.scale = 0.1;
      channel.signal.sentinels = {{32767, Fault::open_circuit}};
    }
  }
  return bus;
}

/// The child: receives until SIGTERM, reports to `to` when ready, and then the received numbers.
[[noreturn]] void receive_and_decode(int to) {
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGTERM);
  sigprocmask(SIG_BLOCK, &ending, nullptr);
  CanSource source(every_signal());
  source.start();
  while (!source.health().connected) std::this_thread::sleep_for(10ms);
  Received received;
  bool is_written = ::write(to, &received, sizeof received) == sizeof received;
  int signal = 0;
  sigwait(&ending, &signal);
  source.stop();
  const BusHealth health = source.health();
  received.dropped = health.dropped;
  for (const UnitHealth& unit : health.units) received.good += unit.answers;
  is_written = is_written && ::write(to, &received, sizeof received) == sizeof received;
  std::_Exit(is_written ? 0 : 1);
}

[[noreturn]] void run_candump() {
  const int nowhere = ::open("/dev/null", O_WRONLY);
  ::dup2(nowhere, STDOUT_FILENO);
  ::execlp("candump", "candump", interface, nullptr);
  std::perror("candump");
  std::_Exit(127);
}

class Sender {
 public:
  Sender() : socket_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    expect(socket_ >= 0, "CAN socket");
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface));
    expect(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
           interface);
    ::setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);
  }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  ~Sender() { ::close(socket_); }

  /// Fills the bus for `duration_s`, in step with the clock every millisecond. @return frames sent
  std::uint64_t fill(double duration_s) {
    const auto all = static_cast<std::uint64_t>(duration_s * bits_per_s / bits_per_frame);
    const auto begin = Clock::now();
    std::uint64_t sent = 0;
    while (sent < all) {
      const double elapsed_s = std::chrono::duration<double>(Clock::now() - begin).count();
      const auto due = static_cast<std::uint64_t>(elapsed_s * bits_per_s / bits_per_frame);
      // After a stall at most the frames of 10 ms at once.
      const std::uint64_t until = std::min({due, all, sent + 90});
      for (; sent < until; ++sent) send(sent);
      std::this_thread::sleep_for(1ms);
    }
    return sent;
  }

 private:
  void send(std::uint64_t number) const {
    can_frame frame{};
    frame.can_id = first_id + static_cast<std::uint32_t>(number % identifiers);
    frame.len = 8;
    std::memcpy(frame.data, &number, sizeof number);
    expect(::write(socket_, &frame, sizeof frame) == sizeof frame, "sending");
  }

  int socket_;
};

/// Runs one receiver under the load.
template <class Child>
Cost measure(Sender& sender, double round_s, bool reports, Child child) {
  std::array<int, 2> pipe{};
  expect(::pipe2(pipe.data(), O_CLOEXEC) == 0, "pipe");
  const pid_t pid = ::fork();
  expect(pid >= 0, "fork");
  if (pid == 0) child(pipe[1]);
  ::close(pipe[1]);
  Cost cost;
  if (reports) {
    expect(::read(pipe[0], &cost.received, sizeof(Received)) == sizeof(Received), "our receiver");
  } else {
    std::this_thread::sleep_for(500ms);  // candump does not report when it listens
  }
  cost.sent = sender.fill(round_s);
  std::this_thread::sleep_for(200ms);
  ::kill(pid, SIGTERM);
  if (reports) {
    expect(::read(pipe[0], &cost.received, sizeof(Received)) == sizeof(Received), "our receiver");
  }
  ::close(pipe[0]);
  int status = 0;
  rusage used{};
  expect(::wait4(pid, &status, 0, &used) == pid, "wait4");
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  cost.cpu_s = seconds(used.ru_utime) + seconds(used.ru_stime);
  return cost;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void run(int rounds, double round_s) {
  Sender sender;
  std::vector<double> ours_s;
  std::vector<double> candump_s;
  std::vector<double> ratios;
  std::uint64_t lost = 0;
  std::uint64_t frames = 1;  // per round
  for (int round = 0; round < rounds; ++round) {
    const Cost ours = measure(sender, round_s, true, [](int to) { receive_and_decode(to); });
    const Cost candump = measure(sender, round_s, false, [](int) { run_candump(); });
    ours_s.push_back(ours.cpu_s);
    candump_s.push_back(candump.cpu_s);
    ratios.push_back(ours.cpu_s / candump.cpu_s);
    frames = ours.sent;
    lost += ours.sent - ours.received.good;
    std::fprintf(stderr,
                 "round %d: %llu frames, ours %.3f s (lost %llu, dropped %llu), candump "
                 "%.3f s\n",
                 round + 1, static_cast<unsigned long long>(ours.sent), ours.cpu_s,
                 static_cast<unsigned long long>(ours.sent - ours.received.good),
                 static_cast<unsigned long long>(ours.received.dropped), candump.cpu_s);
  }
  const double us_per_s = 1e6 / static_cast<double>(frames);
  std::printf("ours_cpu %.2f us_per_frame\n", us_per_s * median(ours_s));
  std::printf("candump_cpu %.2f us_per_frame\n", us_per_s * median(candump_s));
  std::printf("frames_lost %llu frames\n", static_cast<unsigned long long>(lost));
  std::printf("cpu_over_candump %.3f ratio\n", median(ratios));
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(argc > 1 ? std::stoi(argv[1]) : 5, argc > 2 ? std::stod(argv[2]) : 5.0);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "can_ingest: %s\n", error.what());
    return 1;
  }
}
