// Thermocouples read from real CAN interfaces.
#include "drivers/sensors/can_source.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "../unit/controllers/cycle_stub.hpp"
#include "can_bus.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/sensors/make_source.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using test::eventually;
using test::RawSender;
using test::shell;

namespace {

CanSignal temperature(std::uint32_t id, int start, ByteOrder order = ByteOrder::little_endian) {
  CanSignal signal;
  signal.id = id;
  signal.start_bit = start;
  signal.length_bits = 16;
  signal.byte_order = order;
  signal.scale = 0.1;
  signal.sentinels = {{32767, Fault::open_circuit}};
  return signal;
}

/// Node A: sensors 0 and 1 in 0x181 (Intel); node B: sensor 3 in 0x18FF1234 (29 bits, Motorola).
CanBusConfig two_nodes(const std::string& interface) {
  CanBusConfig bus;
  bus.name = "spindle_bus";
  bus.interface = interface;
  bus.reconnect_s = 0.05;
  bus.devices.resize(2);
  bus.devices[0].name = "a";
  bus.devices[0].channels = {{0, temperature(0x181, 0)}, {1, temperature(0x181, 16)}};
  bus.devices[1].name = "b";
  bus.devices[1].channels = {{3, temperature(0x18FF1234, 7, ByteOrder::big_endian)}};
  bus.devices[1].channels[0].signal.extended_id = true;
  return bus;
}

struct Running {
  explicit Running(const CanBusConfig& config) : source(config), readings(4) {
    source.start();
    if (!eventually([&] { return source.health().connected; })) throw std::runtime_error("down");
  }
  const Reading& newest(std::size_t sensor) {
    source.newest(readings);
    return readings[sensor];
  }
  bool becomes(std::size_t sensor, double temp_degC) {
    return eventually([&] { return newest(sensor).temp_degC == Approx(temp_degC); });
  }
  CanSource source;
  std::vector<Reading> readings;
};

}  // namespace

TEST_CASE("FD and classic frames, pages and counters are read on one interface", "[vm][source]") {
  CanBusConfig config = two_nodes("vcan0");
  CanSignal& far = config.devices[0].channels[1].signal;  // sensor 1: beyond a classic frame
  far.id = 0x182;
  far.fd = true;
  far.start_bit = 200;
  far.selectors = {{{0, 8, ByteOrder::little_endian}, {{2, 2}}}};
  config.devices[0].channels[0].counter = CanField{56, 4, ByteOrder::little_endian};
  Running bus(config);
  REQUIRE(shell("cansend vcan0 181#E100000000000001"));
  REQUIRE(bus.becomes(0, 22.5));
  const nanoseconds taken_at = bus.newest(0).taken_at;
  // 32 bytes, the value in bytes 25 and 26; the first frame is of another page.
  const std::string zeros(48, '0');
  REQUIRE(shell("cansend vcan0 182##003" + zeros + "FF000000000000"));
  REQUIRE(shell("cansend vcan0 182##002" + zeros + "E2000000000000"));
  REQUIRE(bus.becomes(1, 22.6));
  // The counter is unchanged: neither value nor time changes.
  REQUIRE(shell("cansend vcan0 181#FF00000000000001"));
  REQUIRE(eventually([&] {
    return bus.source.health().units[0].last_error == "the counter in the frame does not change";
  }));
  CHECK(bus.newest(0).temp_degC == Approx(22.5));
  CHECK(bus.newest(0).taken_at == taken_at);
  REQUIRE(shell("cansend vcan0 181#FF00000000000002"));
  REQUIRE(bus.becomes(0, 25.5));
  CHECK(bus.source.health().units[0].last_error.empty());
  CHECK(bus.source.health().units[0].bad_frames == 0);
}

TEST_CASE("a J1939 group is read from any sender, and from none while two send it",
          "[vm][source]") {
  CanBusConfig config = two_nodes("vcan0");
  CanSignal& group = config.devices[1].channels[0].signal;
  group.id = 0x18FF31FE;
  group.id_mask = 0x03FFFF00;
  Running bus(config);
  REQUIRE(shell("cansend vcan0 14FF3127#012C"));  // also with another priority
  REQUIRE(bus.becomes(3, 30.0));
  CHECK(bus.source.health().units[1].last_error.empty());
  REQUIRE(shell("cansend vcan0 18FF3227#0190"));  // another group
  REQUIRE(shell("cansend vcan0 18FF3131#0190"));
  REQUIRE(eventually([&] { return bus.newest(3).fault == Fault::device_error; }));
  CHECK(bus.source.health().units[1].last_error ==
        "0x14FF3127 and 0x18FF3131 send the same group: choose one by the sensor's key id");
  CHECK(bus.newest(0).fault == Fault::never_read);
}

TEST_CASE("thermocouples are read from frames of cansend and of a raw socket", "[vm][source]") {
  Running bus(two_nodes("vcan0"));
  CHECK(bus.newest(0).fault == Fault::never_read);
  REQUIRE(shell("cansend vcan0 181#E100C9FF"));  // 22.5 and -5.5 degC
  REQUIRE(bus.becomes(0, 22.5));
  CHECK(bus.newest(1).temp_degC == Approx(-5.5));
  CHECK(bus.newest(0).fault == Fault::none);
  CHECK(bus.newest(3).fault == Fault::never_read);
  RawSender sender("vcan0");
  REQUIRE(sender.send(0x18FF1234 | CAN_EFF_FLAG, {0x01, 0x2C}));
  REQUIRE(bus.becomes(3, 30.0));
  REQUIRE(sender.send(0x181, {0xFF, 0x7F, 0xE2, 0x00}));
  REQUIRE(bus.becomes(1, 22.6));
  CHECK(bus.newest(0).fault == Fault::open_circuit);
  CHECK(std::isnan(bus.newest(0).temp_degC));
  CHECK(bus.newest(2).fault == Fault::never_read);  // another bus's sensor is unchanged
  // A frame's readings are published before it is counted.
  CHECK(eventually([&] { return bus.source.health().units[0].answers == 2; }));
  const BusHealth health = bus.source.health();
  CHECK(health.kind == "can");
  CHECK(health.units[0].answering);
  CHECK(health.units[1].answers == 1);
}

TEST_CASE("a reading carries the time of its frame and keeps it until the next", "[vm][source]") {
  Running bus(two_nodes("vcan0"));
  RawSender sender("vcan0");
  const nanoseconds before = monotonic_now();
  REQUIRE(sender.send(0x181, {10, 0, 20, 0}));
  const nanoseconds after = monotonic_now();
  REQUIRE(bus.becomes(0, 1.0));
  const nanoseconds taken_at = bus.newest(0).taken_at;
  // The time stamp is made during send(); the two clocks are read one after the other.
  CHECK(taken_at >= before - 500ms);
  CHECK(taken_at <= after + 500ms);
  REQUIRE(sender.send(0x18FF1234 | CAN_EFF_FLAG, {0, 50}));
  REQUIRE(bus.becomes(3, 5.0));
  CHECK(bus.newest(0).taken_at == taken_at);
  CHECK(bus.newest(3).taken_at > taken_at);
}

TEST_CASE("frames that waited in the queue carry the time of their arrival", "[vm][source]") {
  CanSocket socket("vcan0", {{0x300, false}});
  REQUIRE(socket.open());
  RawSender sender("vcan0");
  REQUIRE(sender.send(0x300, {1}));
  const nanoseconds sent_at = monotonic_now();
  std::this_thread::sleep_for(900ms);
  const auto frames = socket.receive();
  REQUIRE(frames.size() == 1);
  CHECK(frames[0].received_at <= sent_at + 500ms);
}

TEST_CASE("the kernel drops frames nobody asked for", "[vm][source]") {
  CanSocket socket("vcan0", {{0x123, false}, {0x1ABCDEF, true}});
  REQUIRE(socket.open());
  RawSender sender("vcan0");
  for (int i = 0; i < 100; ++i) REQUIRE(sender.send(0x124, {i}));
  REQUIRE(sender.send(0x123 | CAN_EFF_FLAG, {1}));  // the same number, 29 bits
  REQUIRE(sender.send(0x123 | CAN_RTR_FLAG, {}));   // a request, no data
  REQUIRE(sender.send(0x1ABCDEF | CAN_EFF_FLAG, {2}));
  REQUIRE(sender.send(0x123, {3}));
  const auto frames = socket.receive();  // the socket itself does not filter identifiers
  REQUIRE(frames.size() == 2);
  CHECK(frames[0].id == CanId{0x1ABCDEF, true});
  CHECK(frames[1].id == CanId{0x123, false});
}

TEST_CASE("a burst is received in batches without loss", "[vm][source]") {
  CanSocket socket("vcan0", {{0x300, false}});
  REQUIRE(socket.open());
  RawSender sender("vcan0");
  for (int i = 0; i < 150; ++i) REQUIRE(sender.send(0x300, {i}));
  int next = 0;
  for (auto frames = socket.receive(); !frames.empty(); frames = socket.receive()) {
    CHECK(frames.size() <= CanSocket::batch_max);
    for (const CanFrame& frame : frames) CHECK(frame.data[0] == next++);
  }
  CHECK(next == 150);
  CHECK(socket.errors().dropped == 0);
}

TEST_CASE("frames lost because nobody read them are counted", "[vm][source]") {
  CanSocket socket("vcan0", {{0x300, false}});
  REQUIRE(socket.open());
  RawSender sender("vcan0");
  constexpr int sent = 20'000;  // the kernel's 4 MB buffer holds a third of them
  for (int i = 0; i < sent; ++i) {
    if (!sender.send(0x300, {i % 256})) FAIL("frame " << i << " could not be sent");
  }
  std::uint64_t received = 0;
  for (auto frames = socket.receive(); !frames.empty(); frames = socket.receive()) {
    received += frames.size();
  }
  REQUIRE(received < sent);
  REQUIRE(sender.send(0x300, {1}));  // reported by the kernel with the next frame
  CHECK(socket.receive().size() == 1);
  CHECK(received + socket.errors().dropped == sent);
}

TEST_CASE("the error state of an interface is reported, with the time it was entered",
          "[vm][source]") {
  Running bus(two_nodes("vcan0"));
  CHECK(bus.source.health().state == "active");
  REQUIRE(shell("cansend vcan0 181#0A001400"));
  REQUIRE(bus.becomes(0, 1.0));
  const auto message = [&](const std::string& frame, const std::string& state) {
    const nanoseconds before = monotonic_now();
    REQUIRE(shell("cansend vcan0 " + frame));
    REQUIRE(eventually([&] { return bus.source.health().state == state; }));
    CHECK(bus.source.health().state_since >= before);
    CHECK(bus.source.health().state_since <= monotonic_now());
  };
  message("20000004#0004000000000000", "warning");  // RX_WARNING
  CHECK(bus.source.health().last_error == "vcan0: error warning");
  message("20000004#0030000000000000", "passive");  // RX_PASSIVE and TX_PASSIVE
  message("20000004#0008000000000000", "warning");  // on the way back
  message("20000004#0040000000000000", "active");
  CHECK(bus.source.health().last_error.empty());
  const nanoseconds since = bus.source.health().state_since;
  REQUIRE(shell("cansend vcan0 20000004#0001000000000000"));  // an overflow is not a state
  REQUIRE(eventually([&] { return bus.source.health().error_frames == 5; }));
  CHECK(bus.source.health().state == "active");
  CHECK(bus.source.health().state_since == since);
  CHECK(bus.source.health().connected);
  CHECK(bus.newest(0).fault == Fault::none);
}

TEST_CASE("a short frame is a fault of its readings", "[vm][source]") {
  Running bus(two_nodes("vcan0"));
  REQUIRE(shell("cansend vcan0 181#0A0014"));  // three bytes: sensor 0 is complete, sensor 1 is not
  REQUIRE(bus.becomes(0, 1.0));
  CHECK(bus.newest(1).fault == Fault::bad_frame);
}

TEST_CASE("a CANopen bus whose interface was never there has no temperature", "[vm][source]") {
  CanopenBusConfig bus;
  bus.name = "module_bus";
  bus.interface = "vcan9";
  bus.nodes.resize(1);
  bus.nodes[0].name = "a";
  bus.nodes[0].channels.resize(1);
  bus.nodes[0].channels[0].signal = temperature(0x181, 0);
  const auto source = make_source(bus);
  source->start();
  std::vector<Reading> readings(1);
  CHECK(eventually([&] {
    source->newest(readings);
    return readings[0].fault == Fault::no_answer;
  }));
  CHECK_FALSE(source->health().connected);
}
