// Offsets sent to a controller on a real CAN interface.
#include "drivers/controllers/kinds/can/can_controller.hpp"

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

/// Two axes, valid bits and heartbeat in 0x100; read-back in 0x200; spindle speed in 0x201.
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
  config.signals[0].name = "spindle_rpm";
  config.axes[0].name = "z";
  config.axes[1].name = "x";
  config.valid_bits = place(0x100, 32, 8);
  config.heartbeat = place(0x100, 40, 16);
  return config;
}

/// The controller: reports its applied offsets and spindle speed every 20 ms.
class Machine {
 public:
  explicit Machine(const std::string& interface) : bus_(interface), thread_([this] { run(); }) {}
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  ~Machine() {
    stopping = true;
    thread_.join();
  }
  std::atomic<int> applied_counts{0};  ///< first axis, 0.01 um
  std::atomic<bool> sends_applied{true};
  std::atomic<bool> sends_speed{true};
  std::atomic<bool> stopping{false};

 private:
  void run() {
    while (!stopping) {
      const int counts = applied_counts;
      if (sends_applied) bus_.send(0x200, {counts & 0xFF, (counts >> 8) & 0xFF, 0, 0});
      if (sends_speed) bus_.send(0x201, {0xE0, 0x2E});  // 12000
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
  CHECK_FALSE(dump.shows("88 13"));  // 50 um was never sent
}

TEST_CASE("what has left the CAN interface is written, and what waits in its queue is not",
          "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK_FALSE(cycle.state().written);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return cycle.state().written; }));
  CHECK(link.health().write.confirmed_at > monotonic_now() - 5s);
  CHECK(link.health().write.error.empty());
  cycle.hung = true;
  REQUIRE(eventually([&] { return !cycle.state().written; }));
  CHECK(cycle.state().online);
}

TEST_CASE("what the CAN controller applies and measures is read back", "[vm][controller]") {
  Machine machine("vcan0");
  machine.applied_counts = -250;
  CanController link(two_axes("vcan0"));
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

TEST_CASE("no offset is sent before the CAN controller has reported everything",
          "[vm][controller]") {
  Candump dump("vcan0,100:7FF");
  Machine machine("vcan0");
  machine.sends_speed = false;
  CanController link(two_axes("vcan0"));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return link.health().reads > 20; }));
  CHECK_FALSE(cycle.state().online);
  CHECK(dump.text().empty());
  CHECK(link.health().writes == 0);
  const auto says = [&](const std::string& text) { return link.health().last_error == text; };
  CHECK(eventually([&] { return says("frame 0x201 (spindle_rpm) is not received"); }));
  RawSender("vcan0").send(0x201, {0xE0});
  CHECK(eventually([&] { return says("frame 0x201 (spindle_rpm) has too few bytes: 1"); }));
  machine.sends_speed = true;
  REQUIRE(eventually([&] { return dump.shows("100   [7]  64 00"); }));
  CHECK(eventually([&] { return says(""); }));
}

TEST_CASE("a silent CAN controller is offline, and its return is a new epoch", "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return link.health().writes > 3; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;
  machine.sends_applied = false;  // the speed frames continue
  REQUIRE(eventually([&] { return !cycle.state().online; }));
  const std::string silent = "frame 0x200 (applied of axis z, applied of axis x) is not received";
  REQUIRE(eventually([&] { return link.health().last_error == silent; }));
  const std::uint64_t frames = link.health().reads;
  REQUIRE(eventually([&] { return link.health().reads > frames + 5; }));
  CHECK(link.health().last_error == silent);  // its other frames do not clear that error
  machine.applied_counts = 33;
  machine.sends_applied = true;
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().link_epoch == epoch + 1);
  CHECK(cycle.state().applied_um[0] == Approx(0.33));
  CHECK(eventually([&] { return link.health().last_error.empty(); }));
  const std::uint64_t writes = link.health().writes;
  const std::uint64_t reads = link.health().reads;
  REQUIRE(eventually([&] { return link.health().reads > reads + 20; }));
  CHECK(link.health().writes == writes);  // the cycle's commands belong to the old epoch
  cycle.fixed_epoch = 0;
  CHECK(eventually([&] { return link.health().writes > writes; }));
}

TEST_CASE("a bus-off that is over before the link looks takes a new epoch", "[vm][controller]") {
  Machine machine("vcan0");
  CanController link(two_axes("vcan0"));
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  RawSender bus("vcan0");
  for (std::uint64_t round = 1; round <= 20; ++round) {
    const std::uint32_t epoch = cycle.state().link_epoch;
    REQUIRE(bus.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0}));
    REQUIRE(bus.send(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0}));
    REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
    REQUIRE(eventually([&] { return cycle.state().online; }));
    CHECK(link.health().bus_offs == round);
  }
}

TEST_CASE("frames that were on their way do not end a bus-off", "[vm][controller]") {
  CanController link(two_axes("vcan0"));
  Cycle cycle(link);
  RawSender bus("vcan0");
  const std::initializer_list<int> applied{0, 0, 0, 0}, speed{0xE0, 0x2E};
  REQUIRE(eventually(
      [&] { return bus.send(0x200, applied) && bus.send(0x201, speed) && cycle.state().online; }));
  const std::uint64_t reads = link.health().reads;
  REQUIRE(bus.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0}));
  REQUIRE(bus.send(0x200, applied));
  REQUIRE(bus.send(0x201, speed));
  REQUIRE(eventually([&] { return link.health().reads > reads && !cycle.state().online; }));
  CHECK(link.health().state == "bus_off");
}

TEST_CASE("a controller made with python-can takes offsets and shows them applied",
          "[vm][controller]") {
  // Applies 0x100 and reports it in 0x200; its spindle is at rest.
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
  Candump dump("vcan0,100:7FF");
  RawSender bus("vcan0");
  REQUIRE(eventually([&] { return dump.listens(bus, 0x100); }));
  // Only now: on a slow machine candump takes longer to start than the link may be silent.
  ControllerState state;
  REQUIRE(eventually([&] {
    link.newest(state);
    return state.online;
  }));
  OffsetCommand command;
  command.link_epoch = state.link_epoch;
  command.read_back_number = state.read_back_number;
  command.offset_um[0] = 1.5;
  command.valid[0] = true;
  link.offer(command);
  link.stop();
  CHECK(eventually([&] { return dump.shows("100   [7]  96 00 00 00 01"); }));
}

namespace {

constexpr std::uint32_t near_frame = 0x110, far_frame = 0x111, bits_frame = 0x112;
constexpr std::uint32_t near_shown = 0x210, far_shown = 0x211;

/// One axis with two nodes in two frames, with the set's number in the third byte.
CanControllerConfig two_controlled_nodes(const std::string& interface) {
  const auto number = [](std::uint32_t id) {
    CanSignal signal = place(id, 16, 8);
    signal.is_signed = false;
    return signal;
  };
  CanControllerConfig config;
  config.name = "cnc";
  config.interface = interface;
  config.period_s = 0.02;
  config.silent_after_s = 0.5;
  config.reconnect_s = 0.05;
  CanTravel travel;
  travel.nodes_mm = {0.0, 500.0};
  travel.sent.values = {place(near_frame, 0, 16, 0.01), place(far_frame, 0, 16, 0.01)};
  travel.sent.numbers = {number(near_frame), number(far_frame)};
  travel.applied.values = {place(near_shown, 0, 16, 0.01), place(far_shown, 0, 16, 0.01)};
  travel.applied.numbers = {number(near_shown), number(far_shown)};
  CanAxis axis;
  axis.travel = travel;
  config.axes = {axis};
  config.valid_bits = place(bits_frame, 0, 8);
  config.heartbeat = place(bits_frame, 8, 8);
  return config;
}

/// An independent controller: applies complete sets and reports the active one. Its parameters are
/// separate from the link's configuration.
class Interpolator {
 public:
  explicit Interpolator(const std::string& interface)
      : bus_(interface), ear_(interface), thread_([this] { run(); }) {}
  Interpolator(const Interpolator&) = delete;
  Interpolator& operator=(const Interpolator&) = delete;
  ~Interpolator() {
    stopping = true;
    thread_.join();
  }

  struct Node {
    int counts{0};
    int number{-1};
  };
  std::atomic<int> number_in_effect{0};
  std::atomic<int> near_counts{0};
  std::atomic<int> far_counts{0};
  std::atomic<int> far_shown_behind{0};  ///< its frame reports an older set, by this number
  std::atomic<bool> reports{true};
  std::atomic<bool> takes_over{true};
  std::atomic<int> valid{-1};
  std::atomic<int> sets{0};    ///< applied
  std::atomic<int> reused{0};  ///< a number was repeated with other content
  std::atomic<bool> stopping{false};

 private:
  void run() {
    while (!stopping) {
      while (const auto frame = ear_.receive()) take(*frame);
      if (reports) {
        const int number = number_in_effect;
        show(near_shown, near_counts, number);
        show(far_shown, far_counts, number - far_shown_behind);
      }
      std::this_thread::sleep_for(5ms);
    }
  }
  void show(std::uint32_t id, int counts, int number) {
    bus_.send(id, {counts & 0xFF, (counts >> 8) & 0xFF, number & 0xFF});
  }
  void take(const can_frame& frame) {
    if (frame.can_id == bits_frame) {
      valid = frame.data[0];
      return;
    }
    if (frame.can_id != near_frame && frame.can_id != far_frame) return;
    const Node node{static_cast<std::int16_t>(frame.data[0] | (frame.data[1] << 8)), frame.data[2]};
    const bool is_near = frame.can_id == near_frame;
    Node& mine = is_near ? near_ : far_;
    if (mine.number == node.number && mine.counts != node.counts) ++reused;
    mine = node;
    if (near_.number != far_.number || !takes_over) return;
    near_counts = near_.counts;
    far_counts = far_.counts;
    number_in_effect = near_.number;
    ++sets;
  }

  RawSender bus_;
  test::RawReceiver ear_;
  Node near_;
  Node far_;
  std::thread thread_;
};

}  // namespace

TEST_CASE("a set goes in several frames with one number that counts up",
          "[vm][controller][travel]") {
  Interpolator machine("vcan0");
  Candump dump("vcan0,110:7FE");
  CanController link(two_controlled_nodes("vcan0"));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  cycle.want(1, -2.0);
  REQUIRE(eventually([&] { return machine.sets > 300; }));  // more than all 256 numbers
  CHECK(machine.near_counts == 100);
  CHECK(machine.far_counts == -200);
  CHECK(machine.valid == 1);
  CHECK(machine.reused == 0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[1] == Approx(-2.0); }));
  CHECK(cycle.state().applied_um[0] == Approx(1.0));
  CHECK(dump.shows("110   [3]  64 00 FF"));
  CHECK(dump.shows("111   [3]  38 FF FF"));
  CHECK(dump.shows("110   [3]  64 00 00"));
}

TEST_CASE("what is applied counts when all frames carry the number of one set",
          "[vm][controller][travel]") {
  Interpolator machine("vcan0");
  machine.takes_over = false;
  machine.number_in_effect = 7;
  machine.near_counts = 100;
  machine.far_counts = 300;
  CanController link(two_controlled_nodes("vcan0"));
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().applied_um[1] == Approx(3.0));
  const auto shown_again = [&] {
    const std::uint64_t reads = link.health().reads;
    return eventually([&] { return link.health().reads > reads + 8; });
  };
  machine.far_shown_behind = 1;
  REQUIRE(shown_again());
  machine.near_counts = 9000;
  REQUIRE(shown_again());
  CHECK(cycle.state().applied_um[0] == Approx(1.0));  // not the half of another set
  REQUIRE(eventually([&] { return !cycle.state().online; }));
  REQUIRE(
      eventually([&] { return link.health().last_error.find("two sets") != std::string::npos; }));
  machine.near_counts = 50;
  REQUIRE(shown_again());
  machine.far_shown_behind = 0;
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().applied_um[0] == Approx(0.5));
  CHECK(cycle.state().applied_um[1] == Approx(3.0));
  CHECK(eventually([&] { return link.health().last_error.empty(); }));
}

TEST_CASE("while one node must stand, the set stays and its valid bit is 0",
          "[vm][controller][travel]") {
  Interpolator machine("vcan0");
  CanController link(two_controlled_nodes("vcan0"));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  cycle.want(1, 2.0);
  REQUIRE(eventually([&] { return machine.far_counts == 200 && machine.valid == 1; }));
  cycle.want(0, 5.0, false);
  REQUIRE(eventually([&] { return machine.valid == 0; }));
  const int number = machine.number_in_effect;
  const int sets = machine.sets;
  cycle.want(1, 2.5);
  const std::uint64_t writes = link.health().writes;
  REQUIRE(eventually([&] { return link.health().writes > writes + 5; }));
  CHECK(machine.far_counts == 200);
  CHECK(machine.number_in_effect == number);
  CHECK(machine.sets <= sets + 1);  // not even the same set again
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return machine.far_counts == 250; }));
  CHECK(machine.reused == 0);
}
