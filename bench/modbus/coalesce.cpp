// 20 float values of one unit: read as the poller plans them (neighbouring registers in one
// request), and with one_register_a_request (every value for itself). Interleaved rounds over the
// same connection, median of the rounds' ratios.
//
// The serial line is a pseudo terminal of which the server takes the frames' time at 19200 baud
// plus 3 ms before each answer; TCP is this machine's own.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "drivers/modbus/connection.hpp"
#include "drivers/modbus/register_codec.hpp"
#include "drivers/monotonic_clock.hpp"
#include "drivers/sensors/modbus_plan.hpp"
#include "modbus_bench_server.hpp"

namespace {

using namespace thermocomp;

constexpr int values = 20;
constexpr int rounds = 15;

ModbusDeviceConfig device_with(bool one_register_a_request) {
  ModbusDeviceConfig device;
  device.one_register_a_request = one_register_a_request;
  for (int i = 0; i < values; ++i) {
    ModbusChannel channel;
    channel.sensor = static_cast<std::size_t>(i);
    channel.address = static_cast<std::uint16_t>(2 * i);
    channel.encoding = Encoding::float32;
    device.channels.push_back(channel);
  }
  return device;
}

[[noreturn]] void give_up(const char* what) {
  std::fprintf(stderr, "coalesce: %s\n", what);
  std::exit(1);
}

/// One cycle: every request of the plan, every value decoded. The time it took.
nanoseconds cycle(ModbusConnection& connection, const ModbusDeviceConfig& device,
                  const ModbusPlan& plan) {
  std::vector<std::vector<std::uint16_t>> answers;
  const nanoseconds began = monotonic_now();
  for (const PlannedRequest& request : plan.requests) {
    std::vector<std::uint16_t>& words = answers.emplace_back(request.count);
    if (!connection.read(1, request.table, request.address, words).ok()) give_up("no answer");
  }
  const nanoseconds took = monotonic_now() - began;
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    const WordPlace& place = plan.channels[i].value;
    const auto words = std::span(answers[place.request]).subspan(place.offset);
    const ModbusChannel& channel = device.channels[i];
    const Decoded decoded = decode(words, {channel.encoding, channel.word_order}, {});
    if (!(decoded.value == 20.0)) give_up("a value is not the server's");
  }
  return took;
}

double milliseconds_of(nanoseconds time) {
  return static_cast<double>(time.count()) * 1e-6;
}

double median(std::vector<double> list) {
  std::sort(list.begin(), list.end());
  return list[list.size() / 2];
}

/// Median over the rounds of (time of a cycle one by one) / (time of a cycle coalesced).
double ratio_of_times(const char* name, ModbusConnection& connection, int cycles) {
  const ModbusDeviceConfig together = device_with(false);
  const ModbusDeviceConfig apart = device_with(true);
  const ModbusPlan plan_together = plan_requests(together);
  const ModbusPlan plan_apart = plan_requests(apart);
  std::vector<double> ratios;
  std::vector<double> together_ms;
  std::vector<double> apart_ms;
  for (int round = 0; round < rounds; ++round) {
    nanoseconds with{};
    nanoseconds without{};
    for (int i = 0; i < cycles; ++i) {
      with += cycle(connection, together, plan_together);
      without += cycle(connection, apart, plan_apart);
    }
    together_ms.push_back(milliseconds_of(with) / cycles);
    apart_ms.push_back(milliseconds_of(without) / cycles);
    ratios.push_back(apart_ms.back() / together_ms.back());
  }
  std::fprintf(stderr, "%s: %.2f ms a cycle in %zu requests, %.2f ms in %zu\n", name,
               median(together_ms), plan_together.requests.size(), median(apart_ms),
               plan_apart.requests.size());
  return median(ratios);
}

double measure(const char* name, const ModbusLine& line, int cycles) {
  ModbusConnection connection(line);
  if (!connection.connect()) give_up(connection.last_error().c_str());
  return ratio_of_times(name, connection, cycles);
}

}  // namespace

int main() {
  const bench::PseudoTerminal terminal;
  const bench::TcpListener listener;
  const bench::ServerProcess serial([&terminal] { bench::serve_rtu(terminal, 1); });
  const bench::ServerProcess tcp([&listener] { bench::serve_tcp(listener); });
  bench::stay_on_processor(0);
  ModbusLine line;
  line.timeout_ms = 2000.0;
  line.link = ModbusRtu{terminal.device(), 19200, 'N', 8, 1, false};
  const double serial_ratio = measure("19200 baud", line, 1);
  line.link = ModbusTcp{"127.0.0.1", listener.port()};
  const double tcp_ratio = measure("TCP", line, 50);
  std::printf("requests_coalesced %zu requests\n",
              plan_requests(device_with(false)).requests.size());
  std::printf("requests_one_by_one %zu requests\n",
              plan_requests(device_with(true)).requests.size());
  std::printf("serial_time_one_by_one_over_coalesced %.2f ratio\n", serial_ratio);
  std::printf("tcp_time_one_by_one_over_coalesced %.2f ratio\n", tcp_ratio);
  return 0;
}
