// Two comparisons, each within one run.
//
// rate_over_libmodbus: readings per second of a Modbus source at its fastest (32 float32 channels,
// 64 registers of one unit, one request) relative to a loop of `modbus_read_input_registers(64)` of
// libmodbus that decodes the floats, from the same server process over TCP on this machine.
// Alternating rounds, median of the rounds' ratios. Our readings count once decoded and published.
//
// living_rate_half_dead: 8 units on one serial line (a pseudo terminal; the server takes the
// frames' time at 19200 baud plus 3 ms before each answer), of which 4 never answer: readings per
// second of the 4 living, polled as fast as the line allows, relative to 4 living units alone on a
// second such line, polled at the same time (so that other load affects both). Timeout 200 ms and
// back-off up to 30 s, the defaults. Measured over 60 s from 40 s after the start (two full
// back-off cycles); the cost of the time before is printed too.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include <modbus/modbus.h>

#include "drivers/bus_thread.hpp"
#include "drivers/sensors/make_source.hpp"
#include "modbus_bench_server.hpp"

namespace {

using namespace thermocomp;
using namespace std::chrono_literals;

constexpr int channels = 32;
constexpr int registers = 2 * channels;

double seconds_of(nanoseconds time) {
  return static_cast<double>(time.count()) * 1e-9;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

/// High word first. (libmodbus 3.1's float functions use another byte order on this machine.)
float float_at(const std::vector<std::uint16_t>& words, std::size_t at) {
  const std::uint32_t bits = (std::uint32_t{words[at]} << 16) | words[at + 1];
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// Readings per second of the bare loop.
double bare_rate(int port, nanoseconds duration) {
  modbus_t* context = modbus_new_tcp("127.0.0.1", port);
  modbus_set_slave(context, 1);
  if (context == nullptr || modbus_connect(context) != 0) {
    std::fprintf(stderr, "libmodbus: %s\n", modbus_strerror(errno));
    std::exit(1);
  }
  std::vector<std::uint16_t> words(registers);
  std::vector<float> temps(channels);
  std::uint64_t readings = 0;
  const nanoseconds began = monotonic_now();
  while (monotonic_now() - began < duration) {
    if (modbus_read_input_registers(context, 0, registers, words.data()) != registers) {
      std::fprintf(stderr, "libmodbus: %s\n", modbus_strerror(errno));
      std::exit(1);
    }
    for (std::size_t i = 0; i < temps.size(); ++i) temps[i] = float_at(words, 2 * i);
    readings += channels;
  }
  const double rate = static_cast<double>(readings) / seconds_of(monotonic_now() - began);
  if (!(temps[0] == 20.0F)) std::fprintf(stderr, "libmodbus: unexpected value\n");
  modbus_close(context);
  modbus_free(context);
  return rate;
}

ModbusDeviceConfig unit_with(int unit, int count, std::size_t first_sensor) {
  ModbusDeviceConfig device;
  device.name = "unit_" + std::to_string(unit);
  device.unit = unit;
  device.period_s = 1e-6;  // as fast as it can
  for (int i = 0; i < count; ++i) {
    ModbusChannel channel;
    channel.sensor = first_sensor + static_cast<std::size_t>(i);
    channel.address = static_cast<std::uint16_t>(2 * i);
    channel.encoding = Encoding::float32;
    device.channels.push_back(channel);
  }
  return device;
}

/// Good answers of the units up to `living`.
std::uint64_t answers_of(const SensorSource& source, std::size_t living) {
  const BusHealth health = source.health();
  return std::accumulate(
      health.units.begin(), health.units.begin() + static_cast<long>(living), std::uint64_t{0},
      [](std::uint64_t sum, const UnitHealth& unit) { return sum + unit.answers; });
}

/// Answers per second over `duration`.
double answer_rate(const SensorSource& source, std::size_t living, nanoseconds duration) {
  const std::uint64_t before = answers_of(source, living);
  const nanoseconds began = monotonic_now();
  std::this_thread::sleep_for(duration);
  const auto answers = static_cast<double>(answers_of(source, living) - before);
  return answers / seconds_of(monotonic_now() - began);
}

double our_rate(int port, nanoseconds duration) {
  ModbusBusConfig bus;
  bus.name = "bench";
  bus.line.link = ModbusTcp{"127.0.0.1", port};
  bus.devices = {unit_with(1, channels, 0)};
  const std::unique_ptr<SensorSource> source = make_bus_source(bus);
  source->start();
  while (answers_of(*source, 1) == 0) std::this_thread::sleep_for(1ms);
  const double rate = channels * answer_rate(*source, 1, duration);
  std::vector<Reading> all(channels);
  source->newest(all);
  const bool good = std::all_of(all.begin(), all.end(), [](const Reading& reading) {
    return reading.fault == Fault::none && reading.temp_degC == 20.0;
  });
  source->stop();
  if (!good) {
    std::fprintf(stderr, "modbus_poll: a reading was not good\n");
    std::exit(1);
  }
  return rate;
}

double rate_over_libmodbus() {
  const bench::TcpListener listener;
  const bench::ServerProcess server([&listener] { bench::serve_tcp(listener); });
  constexpr int rounds = 31;
  std::vector<double> ratios;
  std::vector<double> bare_rates;
  bare_rate(listener.port(), 500ms);  // warm-up
  for (int round = 0; round < rounds; ++round) {
    double ours = 0.0;
    double bare = 0.0;
    if (round % 2 == 0) bare = bare_rate(listener.port(), 500ms);
    ours = our_rate(listener.port(), 500ms);
    if (round % 2 != 0) bare = bare_rate(listener.port(), 500ms);
    ratios.push_back(ours / bare);
    bare_rates.push_back(bare);
    std::fprintf(stderr, "round %d: ours %.0f, libmodbus %.0f readings/s, ratio %.3f\n", round + 1,
                 ours, bare, ours / bare);
  }
  std::fprintf(stderr, "ratio from %.3f to %.3f; libmodbus median %.0f readings/s\n",
               *std::min_element(ratios.begin(), ratios.end()),
               *std::max_element(ratios.begin(), ratios.end()), median(bare_rates));
  return median(ratios);
}

ModbusBusConfig serial_bus(const std::string& device, int units) {
  ModbusBusConfig bus;
  bus.name = "bench";
  bus.line.link = ModbusRtu{device, 19200, 'N', 8, 1, false};
  for (int unit = 1; unit <= units; ++unit) {
    bus.devices.push_back(unit_with(unit, 4, 4 * static_cast<std::size_t>(unit - 1)));
  }
  return bus;
}

double living_rate_half_dead() {
  constexpr std::size_t living = 4;
  const bench::PseudoTerminal line_alone;
  const bench::PseudoTerminal line_shared;
  const bench::ServerProcess server_alone([&line_alone] { bench::serve_rtu(line_alone, living); });
  const bench::ServerProcess server_shared(
      [&line_shared] { bench::serve_rtu(line_shared, living); });
  const auto alone = make_bus_source(serial_bus(line_alone.device(), 4));
  const auto shared = make_bus_source(serial_bus(line_shared.device(), 8));
  alone->start();
  shared->start();
  const auto ratio_over = [&](nanoseconds duration, const char* what) {
    const std::uint64_t alone_before = answers_of(*alone, living);
    const std::uint64_t shared_before = answers_of(*shared, living);
    std::this_thread::sleep_for(duration);
    const auto of_alone = static_cast<double>(answers_of(*alone, living) - alone_before);
    const auto of_shared = static_cast<double>(answers_of(*shared, living) - shared_before);
    std::fprintf(stderr, "%s: answers/s of the living alone %.2f, beside 4 dead %.2f, ratio %.3f\n",
                 what, of_alone / seconds_of(duration), of_shared / seconds_of(duration),
                 of_shared / of_alone);
    return of_shared / of_alone;
  };
  ratio_over(10s, "first 10 s");
  ratio_over(30s, "10 s to 40 s");
  const double steady = ratio_over(60s, "40 s to 100 s");
  shared->stop();
  alone->stop();
  return steady;
}

}  // namespace

int main() {
  bench::stay_on_processor(0);
  const double over_libmodbus = rate_over_libmodbus();
  const double half_dead = living_rate_half_dead();
  std::printf("rate_over_libmodbus %.3f ratio\n", over_libmodbus);
  std::printf("living_rate_half_dead %.3f ratio\n", half_dead);
  return 0;
}
