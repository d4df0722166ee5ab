// The peer of bench/daemon/footprint.sh, a minimal poller: a 100 Hz timer and, once a second, one
// read of the registers with libmodbus; nothing is decoded, stored or sent.
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <time.h>
#include <vector>

#include <modbus/modbus.h>

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: bench_bare_poller PORT REGISTERS\n");
    return 2;
  }
  modbus_t* line = modbus_new_tcp("127.0.0.1", std::atoi(argv[1]));
  modbus_set_slave(line, 1);
  if (modbus_connect(line) != 0) {
    std::fprintf(stderr, "bench_bare_poller: %s\n", modbus_strerror(errno));
    return 1;
  }
  std::vector<std::uint16_t> registers(static_cast<std::size_t>(std::atoi(argv[2])));
  timespec wake{};
  clock_gettime(CLOCK_MONOTONIC, &wake);
  for (unsigned tick = 0;; ++tick) {
    wake.tv_nsec += 10'000'000;
    if (wake.tv_nsec >= 1'000'000'000) {
      wake.tv_nsec -= 1'000'000'000;
      ++wake.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
    if (tick % 100 == 0)
      modbus_read_input_registers(line, 0, static_cast<int>(registers.size()), registers.data());
  }
}
