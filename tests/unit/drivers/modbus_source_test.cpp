#include <cmath>
#include <future>
#include <memory>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/sensors/make_source.hpp"
#include "modbus_peer.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

ModbusDeviceConfig device_of(int unit, std::size_t first_sensor, const std::vector<int>& addresses,
                             double period_s = 0.02) {
  ModbusDeviceConfig device;
  device.name = "unit_" + std::to_string(unit);
  device.unit = unit;
  device.period_s = period_s;
  for (const int address : addresses) {
    ModbusChannel channel;
    channel.sensor = first_sensor++;
    channel.address = static_cast<std::uint16_t>(address);
    channel.encoding = Encoding::uint16;
    device.channels.push_back(channel);
  }
  return device;
}

ModbusBusConfig tcp_bus(int port) {
  ModbusBusConfig bus;
  bus.name = "test";
  bus.line.link = ModbusTcp{"127.0.0.1", port};
  bus.line.reconnect_s = 0.1;
  return bus;
}

ModbusBusConfig rtu_bus(const std::string& device) {
  ModbusBusConfig bus;
  bus.name = "test";
  bus.line.link = ModbusRtu{device, 115200, 'N', 8, 1, false};
  bus.line.timeout_ms = 60.0;
  bus.line.reconnect_s = 0.1;
  return bus;
}

/// A started source with its readings as seen by the cycle.
struct Running {
  std::unique_ptr<SensorSource> source;
  std::vector<Reading> all;

  explicit Running(const ModbusBusConfig& bus, std::size_t sensors = 8)
      : source(make_bus_source(bus)), all(sensors) {
    source->start();
  }
  const Reading& reading(std::size_t sensor) {
    source->newest(all);
    return all[sensor];
  }
  bool becomes(std::size_t sensor, double value) {
    return peer::eventually(
        [&] { return reading(sensor).fault == Fault::none && all[sensor].temp_degC == value; });
  }
  bool becomes(std::size_t sensor, Fault fault) {
    return peer::eventually([&] { return reading(sensor).fault == fault; });
  }
};

}  // namespace

TEST_CASE("readings have value and time, at the indices of their sensors", "[source]") {
  peer::TcpDevice device;
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.devices = {device_of(1, 4, {0, 30}), device_of(2, 1, {7})};
  bus.devices[1].channels[0].scale = 0.1;
  const auto began = monotonic_now();
  Running running(bus);
  CHECK(running.becomes(4, 1000.0));
  CHECK(running.becomes(5, 1030.0));
  CHECK(peer::eventually([&] { return running.reading(1).fault == Fault::none; }));
  CHECK(running.all[1].temp_degC == Approx(200.7));
  CHECK(running.all[1].taken_at > began);
  CHECK(running.all[1].taken_at <= monotonic_now());
  CHECK(running.all[0].fault == Fault::never_read);  // a sensor of another bus is unchanged
  const auto taken_at = running.all[4].taken_at;
  CHECK(peer::eventually([&] { return running.reading(4).taken_at > taken_at; }));
  const BusHealth health = running.source->health();
  CHECK(health.kind == "modbus_tcp");
  CHECK(health.connected);
  CHECK(health.units.at(0).answering);
  CHECK(health.units.at(0).answers > 0);
}

TEST_CASE("before the first answer a reading is never_read", "[source]") {
  peer::SerialLine line([](const peer::Request&) { return peer::Reply{}; });
  ModbusBusConfig bus = rtu_bus(line.device());
  bus.line.timeout_ms = 5000.0;
  bus.devices = {device_of(1, 0, {0})};
  Running running(bus);
  CHECK(running.reading(0).fault == Fault::never_read);
  CHECK(std::isnan(running.all[0].temp_degC));
}

TEST_CASE("sentinels and status registers are faults of their channel only", "[source]") {
  peer::TcpDevice device([](const peer::Request& request) {
    if (request.function == 2) return peer::Reply{{2, 1, 0x02}};  // second channel: broken
    return peer::Reply{peer::registers_pdu(4, {250, 251, 0xFFFF})};
  });
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.devices = {device_of(1, 0, {0, 1, 2})};
  for (std::uint16_t i = 0; i < 3; ++i) {
    ModbusChannel& channel = bus.devices[0].channels[i];
    channel.sentinels = {{0xFFFF, Fault::out_of_range}};
    channel.status =
        ModbusStatus{ModbusTable::discrete_input, i, 0xFFFF, {{1, Fault::open_circuit}}};
  }
  Running running(bus);
  CHECK(running.becomes(0, 250.0));
  CHECK(running.becomes(1, Fault::open_circuit));
  CHECK(running.becomes(2, Fault::out_of_range));
  CHECK(std::isnan(running.all[1].temp_degC));
}

TEST_CASE("a value whose status was read earlier is as old as the status", "[source]") {
  std::mutex mutex;
  std::vector<std::pair<int, nanoseconds>> asked;  // function, when it was served
  peer::TcpDevice device([&](const peer::Request& request) {
    const std::lock_guard lock(mutex);
    asked.emplace_back(request.function, monotonic_now());
    if (asked.size() == 2) return peer::Reply{};  // lost: the next round begins with this one
    const std::uint16_t word = request.function == 3 ? 250 : 0;
    return peer::Reply{peer::registers_pdu(request.function, {word})};
  });
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.line.timeout_ms = 100.0;
  bus.line.retries = 1;
  bus.devices = {device_of(1, 0, {0}, 3600.0)};
  bus.devices[0].channels[0].table = ModbusTable::holding;
  bus.devices[0].channels[0].status =
      ModbusStatus{ModbusTable::input, 0, 0xFFFF, {{1, Fault::open_circuit}}};
  Running running(bus);
  REQUIRE(running.becomes(0, 250.0));
  const std::lock_guard lock(mutex);
  REQUIRE(asked.size() == 4);
  CHECK(asked[1].first == 4);
  CHECK(asked[3].first == 3);
  CHECK(running.all[0].taken_at > asked[2].second);
  CHECK(running.all[0].taken_at < asked[3].second);
}

TEST_CASE("a busy or failing device gives a fault, and a value again afterwards", "[source]") {
  peer::TcpDevice device;
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.devices = {device_of(1, 0, {0})};
  Running running(bus);
  REQUIRE(running.becomes(0, 1000.0));
  device.handle([](const auto& r) { return peer::exception(r, 6); });
  REQUIRE(running.becomes(0, Fault::device_busy));
  CHECK(std::isnan(running.all[0].temp_degC));
  const auto last_good = running.all[0].taken_at;
  CHECK(last_good > 0ns);
  device.handle([](const auto& r) { return peer::exception(r, 4); });
  CHECK(running.becomes(0, Fault::device_error));
  CHECK(running.all[0].taken_at == last_good);  // the time of the last value is kept
  device.handle(peer::correct);
  CHECK(running.becomes(0, 1000.0));
}

TEST_CASE("a dead unit has no answer, the others continue, and it returns", "[source]") {
  std::atomic<bool> dead{true};
  peer::SerialLine line([&dead](const peer::Request& request) {
    return request.unit == 2 && dead ? peer::Reply{} : peer::correct(request);
  });
  ModbusBusConfig bus = rtu_bus(line.device());
  bus.line.backoff_s_max = 2.0;
  bus.devices = {device_of(1, 0, {0}), device_of(2, 1, {0}), device_of(3, 2, {0})};
  Running running(bus);
  CHECK(running.becomes(1, Fault::no_answer));
  CHECK(running.becomes(0, 1000.0));
  CHECK(running.becomes(2, 3000.0));
  const BusHealth health = running.source->health();
  CHECK_FALSE(health.units.at(1).answering);
  CHECK(health.units.at(1).timeouts > 0);
  CHECK_FALSE(health.units.at(1).last_error.empty());
  const auto before = running.source->health().units.at(0).answers;
  CHECK(peer::eventually([&] { return running.source->health().units[0].answers > before + 20; }));
  dead = false;
  CHECK(running.becomes(1, 2000.0));
}

TEST_CASE("registers that are never answered leave the others readable", "[source]") {
  peer::TcpDevice device([](const peer::Request& request) {
    return request.address == 100 ? peer::Reply{} : peer::correct(request);
  });
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.line.timeout_ms = 50.0;
  bus.devices = {device_of(1, 0, {0, 100, 200})};
  Running running(bus);
  CHECK(running.becomes(1, Fault::no_answer));
  CHECK(running.becomes(0, 1000.0));
  CHECK(running.becomes(2, 1200.0));
  const auto seen = running.all[2].taken_at;
  CHECK(peer::eventually([&] { return running.reading(2).taken_at > seen; }));
}

TEST_CASE("a server that closes idle connections costs no reading", "[source][reconnect]") {
  std::atomic<int> count{0};
  peer::TcpDevice device([&count](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    reply.close = ++count % 5 == 0;
    return reply;
  });
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.line.reconnect_s = 0.01;
  bus.devices = {device_of(1, 0, {0}, 0.05)};
  Running running(bus);
  REQUIRE(running.becomes(0, 1000.0));
  const bool faulty = [&] {
    for (int i = 0; i < 1500; ++i) {
      if (running.reading(0).fault != Fault::none) return true;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }();
  CHECK_FALSE(faulty);
  CHECK(device.connections() > 2);
}

TEST_CASE("a serial port that vanishes and returns is read again", "[source][reconnect]") {
  peer::SerialLine line;
  ModbusBusConfig bus = rtu_bus(line.device());
  bus.devices = {device_of(1, 0, {0})};
  Running running(bus);
  REQUIRE(running.becomes(0, 1000.0));
  line.unplug();
  REQUIRE(running.becomes(0, Fault::no_answer));
  CHECK(peer::eventually([&] { return !running.source->health().connected; }));
  line.plug_in();
  CHECK(running.becomes(0, 1000.0));
}

TEST_CASE("while the renewal counter does not change, neither do the times", "[source]") {
  std::atomic<std::uint16_t> counter{1};
  peer::TcpDevice device([&counter](const peer::Request& request) {
    if (request.address == 90) return peer::Reply{peer::registers_pdu(4, {counter})};
    return peer::correct(request);
  });
  ModbusBusConfig bus = tcp_bus(device.port());
  bus.devices = {device_of(1, 0, {0})};
  bus.devices[0].renewal = ModbusRenewal{ModbusTable::input, 90};
  Running running(bus);
  REQUIRE(running.becomes(0, 1000.0));
  const auto taken_at = running.all[0].taken_at;
  const int asked = device.requests();
  REQUIRE(peer::eventually([&] { return device.requests() > asked + 20; }));
  CHECK(running.reading(0).taken_at == taken_at);
  ++counter;
  CHECK(peer::eventually([&] { return running.reading(0).taken_at > taken_at; }));
}

TEST_CASE("stop ends any wait within a second", "[source]") {
  peer::TcpDevice silent([](const peer::Request&) { return peer::Reply{}; });
  ModbusBusConfig bus = tcp_bus(silent.port());
  bus.line.timeout_ms = 60000.0;
  bus.devices = {device_of(1, 0, {0})};
  const bool nobody = GENERATE(false, true);
  if (nobody) bus.line.link = ModbusTcp{"no-such-host.invalid", 502};
  const std::unique_ptr<SensorSource> source = make_bus_source(bus);
  source->start();
  std::this_thread::sleep_for(100ms);
  const auto began = peer::steady_clock::now();
  source->stop();
  CHECK(peer::steady_clock::now() - began < 1s);
}

TEST_CASE("an impossible configuration is refused with the device's name", "[source]") {
  ModbusBusConfig good = tcp_bus(502);
  good.devices = {device_of(1, 0, {0})};
  const auto refused = [&good](const std::function<void(ModbusBusConfig&)>& spoil) {
    ModbusBusConfig bus = good;
    spoil(bus);
    CHECK_THROWS_AS(make_bus_source(bus), DriverError);
  };
  CHECK_NOTHROW(make_bus_source(good));
  refused([](auto& bus) { bus.devices[0].unit = 256; });
  refused([](auto& bus) { bus.devices[0].unit = -1; });
  refused([](auto& bus) { bus.devices[0].period_s = 0.0; });
  refused([](auto& bus) { bus.devices[0].period_s = not_a_number; });
  refused([](auto& bus) { bus.devices[0].registers_per_request_max = 126; });
  refused([](auto& bus) { bus.devices[0].registers_per_request_max = 0; });
  refused([](auto& bus) { bus.devices[0].gap_registers_max = -1; });
  refused([](auto& bus) { bus.devices[0].channels.clear(); });
  refused([](auto& bus) { bus.devices.clear(); });
  refused([](auto& bus) { bus.devices[0].channels[0].scale = 0.0; });
  refused([](auto& bus) { bus.devices[0].channels[0].offset_degC = not_a_number; });
  refused([](auto& bus) {
    bus.devices[0].channels[0].address = 65535;
    bus.devices[0].channels[0].encoding = Encoding::float32;
  });
  refused([](auto& bus) {
    bus.devices[0].channels[0].sentinels = {{-1, Fault::open_circuit}};  // never in uint16
  });
  refused([](auto& bus) {
    bus.line.link = ModbusRtu{"/dev/null"};
    bus.devices[0].unit = 0;  // a broadcast has no answer
  });
}
