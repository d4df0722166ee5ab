// Offsets sent to a controller on a real CAN interface.
#include "drivers/controllers/can_controller.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <string>
#include <thread>

#include <catch2/catch.hpp>
#include <linux/can/error.h>

#include "../unit/controllers/cycle_stub.hpp"
#include "can_bus.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using test::Background;
using test::Candump;
using test::Cycle;
using test::eventually;
using test::RawSender;
using test::shell;

namespace {

CanSignal place(std::uint32_t id, int start, int length, double scale = 1.0) {
  CanSignal signal;
  signal.id = id;
  signal.start_bit = start;
  signal.length_bits = length;
  signal.scale = scale;
  return signal;
}

/// Two axes, valid bits and heartbeat in 0x100; applied in 0x200; spindle speed in 0x201.
CanControllerConfig two_axes(const std::string& interface) {
  CanControllerConfig config;
  config.name = "cnc";
  config.interface = interface;
  config.period_s = 0.02;
  config.silent_after_s = 0.5;
  config.reconnect_s = 0.05;
  config.axes = {{place(0x100, 0, 16, 0.01), place(0x200, 0, 16, 0.01)},
                 {place(0x100, 16, 16, 0.01), place(0x200, 16, 16, 0.01)}};
  config.signals = {{4, place(0x201, 0, 16)}};
  config.signals[0].value.is_signed = false;
  config.valid_bits = place(0x100, 32, 8);
  config.heartbeat = place(0x100, 40, 16);
  return config;
}

/// The controller's side: tells every 20 ms what it applies and its spindle speed.
class Machine {
 public:
  explicit Machine(const std::string& interface) : bus_(interface), thread_([this] { run(); }) {}
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  ~Machine() {
    stopping = true;
    thread_.join();
  }
  std::atomic<int> applied_counts{0};  ///< of the first axis, 0.01 um
  std::atomic<bool> tells_applied{true};
  std::atomic<bool> tells_speed{true};
  std::atomic<bool> stopping{false};

 private:
  void run() {
    while (!stopping) {
      const int counts = applied_counts;
      if (tells_applied) bus_.send(0x200, {counts & 0xFF, (counts >> 8) & 0xFF, 0, 0});
      if (tells_speed) bus_.send(0x201, {0xE0, 0x2E});  // 12000
      std::this_thread::sleep_for(20ms);
    }
  }
  RawSender bus_;
  std::thread thread_;
};

}  // namespace

TEST_CASE("candump sees the offsets, several signals in one frame", "[vm][controller]") {
  Candump dump("vcan0,100:7FF");
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  cycle.want(0, 12.34);  // 1234 = 0x04D2
  cycle.want(1, -7.0);   // -700 = 0xFD44
  REQUIRE(eventually([&] { return dump.shows("vcan0  100   [7]  D2 04 44 FD 03"); }));
  cycle.want(1, 50.0, false);
  REQUIRE(eventually([&] { return dump.shows("vcan0  100   [7]  D2 04 44 FD 01"); }));
  cycle.want(0, -0.01);
  REQUIRE(eventually([&] { return dump.shows("vcan0  100   [7]  FF FF 44 FD 01"); }));
  const std::uint64_t writes = link.health().writes;
  REQUIRE(eventually([&] { return link.health().writes > writes + 5; }));
  CHECK_FALSE(dump.shows("88 13"));  // 50 um was never on the bus
}

TEST_CASE("what the CAN controller applies and measures is read back", "[vm][controller]") {
  Machine machine("vcan0");
  machine.applied_counts = -250;
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  const ControllerState state = cycle.state();
  CHECK(state.link_epoch == 1);
  CHECK(state.applied_um[0] == Approx(-2.5));
  CHECK(state.applied_um[1] == 0.0);
  CHECK(std::isnan(state.applied_um[2]));
  CHECK(state.signals[4] == 12000.0);
  CHECK(std::isnan(state.signals[0]));
  CHECK(state.taken_at <= monotonic_now());
  CHECK(state.taken_at > monotonic_now() - 5s);
  machine.applied_counts = 100;
  CHECK(eventually([&] { return cycle.state().applied_um[0] == Approx(1.0); }));
}

TEST_CASE("no offset is sent before the CAN controller has told everything", "[vm][controller]") {
  Candump dump("vcan0,100:7FF");
  Machine machine("vcan0");
  machine.tells_speed = false;
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return link.health().reads > 20; }));
  CHECK_FALSE(cycle.state().online);
  CHECK(dump.text().empty());
  CHECK(link.health().writes == 0);
  machine.tells_speed = true;
  REQUIRE(eventually([&] { return dump.shows("100   [7]  64 00"); }));
}

TEST_CASE("a silent CAN controller is offline, and its return is a new epoch", "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return link.health().writes > 3; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;
  machine.tells_applied = false;  // the speed goes on
  REQUIRE(eventually([&] { return !cycle.state().online; }));
  const std::string silent = "the controller is silent";
  REQUIRE(eventually([&] { return link.health().last_error == silent; }));
  const std::uint64_t frames = link.health().reads;
  REQUIRE(eventually([&] { return link.health().reads > frames + 5; }));
  CHECK(link.health().last_error == silent);  // other frames of it are no reason to forget that
  machine.applied_counts = 33;
  machine.tells_applied = true;
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().link_epoch == epoch + 1);
  CHECK(cycle.state().applied_um[0] == Approx(0.33));
  CHECK(eventually([&] { return link.health().last_error.empty(); }));
  const std::uint64_t writes = link.health().writes;
  const std::uint64_t reads = link.health().reads;
  REQUIRE(eventually([&] { return link.health().reads > reads + 20; }));
  CHECK(link.health().writes == writes);  // the cycle's commands are of the old epoch
  cycle.fixed_epoch = 0;
  CHECK(eventually([&] { return link.health().writes > writes; }));
}

TEST_CASE("a CAN link that goes down, is bus-off or cut takes a new epoch", "[vm][controller]") {
  REQUIRE(shell("ip link add dev vcan9 type vcan && ip link set vcan9 up"));
  {
    Machine machine("vcan9");
    CanController link(two_axes("vcan9"));
    link.start();
    Cycle cycle(link);
    cycle.want(0, 1.0);
    REQUIRE(eventually([&] { return link.health().writes > 3; }));
    REQUIRE(shell("ip link set vcan9 down"));
    REQUIRE(eventually([&] { return !cycle.state().online; }));
    REQUIRE(shell("ip link set vcan9 up"));
    REQUIRE(eventually([&] { return cycle.state().online && cycle.state().link_epoch >= 2; }));
    CHECK(link.health().connects == 2);
    const std::uint32_t epoch = cycle.state().link_epoch;
    CHECK(link.health().state == "active");
    REQUIRE(shell("cansend vcan9 20000040#0000000000000000"));
    REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
    CHECK(link.health().bus_offs == 1);
    REQUIRE(eventually([&] { return cycle.state().online; }));
  }
  REQUIRE(shell("ip link del vcan9"));
}

TEST_CASE("a bus-off that is over before the link looks takes a new epoch", "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  RawSender bus("vcan0");
  for (std::uint64_t round = 1; round <= 20; ++round) {
    const std::uint32_t epoch = cycle.state().link_epoch;
    REQUIRE(bus.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0}));
    REQUIRE(bus.send(0x201, {0xE0, 0x2E}));  // the next frame ends it
    REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
    REQUIRE(eventually([&] { return cycle.state().online; }));
    CHECK(link.health().bus_offs == round);
  }
}

TEST_CASE("the CAN heartbeat stops when the cycle stands still", "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  link.start();
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return link.health().writes > 3; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.hung = true;
  std::uint64_t writes = 0;
  REQUIRE(eventually([&] {
    writes = link.health().writes;
    std::this_thread::sleep_for(300ms);
    return link.health().writes == writes;
  }));
  CHECK(cycle.state().online);
  std::this_thread::sleep_for(1200ms);
  CHECK(link.health().writes == writes);
  cycle.hung = false;
  REQUIRE(eventually([&] { return link.health().writes > writes; }));
  CHECK(cycle.state().link_epoch > epoch);
}

TEST_CASE("a controller made with python-can takes offsets and shows them applied",
          "[vm][controller]") {
  // It applies what 0x100 brings, tells it in 0x200, and its spindle stands still.
  const Background peer(
      "/usr/bin/python3 -c \"\n"
      "import can\n"
      "bus = can.Bus('vcan1', bustype='socketcan')\n"
      "applied = bytes(4)\n"
      "while True:\n"
      "    got = bus.recv(0.02)\n"
      "    if got is not None and got.arbitration_id == 0x100 and got.data[4] == 3:\n"
      "        applied = bytes(got.data[0:4])\n"
      "    for id, data in ((0x200, applied), (0x201, bytes(2))):\n"
      "        bus.send(can.Message(arbitration_id=id, is_extended_id=False, data=data))\n\"");
  CanController link(two_axes("vcan1"));
  link.start();
  Cycle cycle(link);
  cycle.want(0, 21.5);
  cycle.want(1, -30.25);
  REQUIRE(eventually([&] { return cycle.state().applied_um[1] == Approx(-30.25); }));
  CHECK(cycle.state().applied_um[0] == Approx(21.5));
  CHECK(cycle.state().signals[4] == 0.0);
  CHECK(cycle.state().link_epoch == 1);
}

TEST_CASE("the end of the CAN link sends the newest command once more", "[vm][controller]") {
  Machine machine("vcan0");
  CanControllerConfig config = two_axes("vcan0");
  config.period_s = 60.0;
  CanController link(config);
  link.start();
  ControllerState state;
  REQUIRE(eventually([&] {
    link.newest(state);
    return state.online;
  }));
  Candump dump("vcan0,100:7FF");
  RawSender bus("vcan0");
  REQUIRE(eventually([&] { return dump.listens(bus, 0x100); }));
  OffsetCommand command;
  command.link_epoch = state.link_epoch;
  command.look = state.look;
  command.offset_um[0] = 1.5;
  command.valid[0] = true;
  link.offer(command);
  link.stop();
  CHECK(eventually([&] { return dump.shows("100   [7]  96 00 00 00 01"); }));
}
