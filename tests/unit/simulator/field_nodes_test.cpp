// Tests of simulated CANopen and J1939 nodes, connected to the daemon's drivers without a bus.
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "simulator/devices/canopen_slave.hpp"
#include "simulator/devices/j1939_sender.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr double long_s = 1e9;

/// Exchanges frames in both directions in steps of 10 ms.
template <class Line, class Take>
void exchange(Line& line, nanoseconds& now, nanoseconds time, const std::vector<double>& temps_degC,
              auto& node, Take take) {
  for (const nanoseconds end = now + time; now < end;) {
    now += 10ms;
    node.update(now, temps_degC);
    for (bool any = true; any;) {
      any = false;
      while (auto frame = node.next_frame()) {
        frame->received_at = now;
        line.take(*frame);
        any = true;
      }
      line.advance(now);
      while (const auto frame = line.next_frame()) {
        take(*frame);
        any = true;
      }
    }
  }
}

SimulatedCanopenNode two_channels() {
  SimulatedCanopenNode node;
  node.name = "node";
  node.interface = "vcan0";
  node.node = 5;
  node.cob_id = 0x195;
  node.channels = {{"front_degC"}, {"back_degC"}};
  return node;
}

CanopenBusConfig master() {
  CanopenBusConfig bus;
  bus.name = "bus";
  bus.interface = "vcan0";
  CanopenNodeConfig& node = bus.nodes.emplace_back();
  node.name = "module";
  node.node = 5;
  node.heartbeat_s = 0.1;
  node.heartbeat_timeout_s = 0.5;
  node.emergency = EmergencyForm::jumo;
  node.writes = {{{0x6110, 1}, {1, 0}}};
  node.mappings_read = {1};
  for (std::uint8_t sub = 1; sub <= 2; ++sub) {
    CanopenChannel channel;
    channel.sensor = sub - 1u;
    channel.way = CanopenWay::pdo_object;
    channel.object = {0x7130, sub};
    channel.signal.length_bits = 16;
    channel.signal.scale = 0.1;
    channel.emergency_channel = sub;
    node.channels.push_back(channel);
  }
  CanopenChannel polled = node.channels[1];
  polled.sensor = 2;
  polled.way = CanopenWay::sdo;
  polled.poll_s = 0.2;
  polled.emergency_channel = 0;
  node.channels.push_back(polled);
  return bus;
}

struct Pair {
  explicit Pair(const SimulatedCanopenNode& config) : line(master()), node(config, now) {
    line.opened(now);
  }
  void run(nanoseconds time) {
    exchange(line, now, time, {21.5, -3.2}, node, [&](const CanFrame& f) { node.take(f, now); });
  }
  [[nodiscard]] Fault fault(std::size_t i) const { return line.readings()[i].fault; }
  nanoseconds now{1000s};
  CanopenLine line;
  CanopenSlave node;
};

}  // namespace

TEST_CASE("a simulated node is set up, asked for its mapping, started and read", "[nodes]") {
  Pair pair(two_channels());
  pair.run(2s);
  INFO(pair.line.health(pair.now)[0].last_error);
  CHECK(pair.line.readings()[0].temp_degC == Approx(21.5));
  CHECK(pair.line.readings()[1].temp_degC == Approx(-3.2));
  CHECK(pair.line.readings()[2].temp_degC == Approx(-3.2));
}

TEST_CASE("each event of a simulated node causes its fault, and ends", "[nodes]") {
  SimulatedCanopenNode config = two_channels();
  const auto with = [&](NodeEventKind kind, std::size_t channel) {
    config.events = {{kind, channel, 2.0, 2.0}};
    Pair pair(config);
    pair.run(1s);
    CHECK(pair.fault(0) == Fault::none);
    pair.run(2s);
    std::vector<Fault> during{pair.fault(0), pair.fault(1), pair.fault(2)};
    pair.run(4s);
    for (std::size_t i = 0; i < 3; ++i) CHECK(pair.fault(i) == Fault::none);
    return during;
  };
  using Faults = std::vector<Fault>;
  CHECK(with(NodeEventKind::open_circuit, 0)[0] == Fault::open_circuit);
  CHECK(with(NodeEventKind::short_circuit, 1)[1] == Fault::short_circuit);
  CHECK(with(NodeEventKind::heartbeat_loss, 0) == Faults(3, Fault::no_answer));
  CHECK(with(NodeEventKind::silence, 0) == Faults(3, Fault::no_answer));
  CHECK(with(NodeEventKind::sdo_abort, 0) == Faults{Fault::none, Fault::none, Fault::device_error});
}

TEST_CASE("a text in a simulated node's dictionary is read in segments", "[nodes]") {
  nanoseconds now{1000s};
  CanopenSlave node(two_channels(), now);
  while (node.next_frame()) {
  }
  SdoClient client(5, 500ms);
  client.read({0x1008, 0}, now);
  while (client.busy()) {
    while (const auto frame = client.next_frame()) node.take(*frame, now);
    while (const auto frame = node.next_frame()) client.take(frame->payload(), now);
  }
  const auto result = client.result();
  REQUIRE(result);
  CHECK(std::string(result->bytes.begin(), result->bytes.end()) == "thermocomp-sim CANopen node");
}

TEST_CASE("a simulated J1939 node: single frames, packets, NAME and error code", "[nodes]") {
  SimulatedJ1939Node sender;
  sender.address = 0x80;
  sender.name_claimed = 0x00FF001234;
  J1939Parameter place;
  place.pgn = 0xFF10;
  place.start_byte = 2;
  place.scale = 0.03125;
  place.offset = -273.0;
  place.error = Fault::open_circuit;
  sender.channels = {{"a_degC", place}, {"b_degC", place}};
  sender.channels[1].place.pgn = 0xFF11;
  sender.channels[1].place.start_byte = 20;
  sender.events = {{NodeEventKind::open_circuit, 0, 2.0, long_s}};
  J1939BusConfig bus;
  bus.name = "bus";
  bus.interface = "vcan0";
  J1939NodeConfig& device = bus.nodes.emplace_back();
  device.name = "module";
  device.name_claimed = sender.name_claimed;
  for (std::size_t i = 0; i < 2; ++i) device.channels.push_back({i, sender.channels[i].place});
  nanoseconds now{1000s};
  J1939Line line(bus);
  line.opened(now);
  J1939Sender node(sender, now);
  const auto run = [&](nanoseconds time) {
    exchange(line, now, time, {21.5, -3.25}, node, [&](const CanFrame& f) { node.take(f, now); });
  };
  run(1s);
  CHECK(line.readings()[0].temp_degC == Approx(21.5));
  CHECK(line.readings()[1].temp_degC == Approx(-3.25));
  run(2s);
  CHECK(line.readings()[0].fault == Fault::open_circuit);
  CHECK(line.readings()[1].fault == Fault::none);
}
