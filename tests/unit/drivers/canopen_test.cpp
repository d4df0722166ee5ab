// State machines of CANopen, with the bytes of CiA 301 written by hand.
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "canopen_bus.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

// ------------------------------------------------------------------ states of a node

TEST_CASE("a node is started at once and again after its reboot", "[canopen][node]") {
  Bus bus(bus_of({node_5({in_pdo(0, 0x185, 0)})}));
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  CHECK(bus.fault() == Fault::no_answer);
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.temp_degC() == Approx(22.5));
  CHECK(bus.line.readings()[0].taken_at == bus.now);
  bus.put(0x705, {0x00});  // boot-up
  CHECK(bus.fault() == Fault::no_answer);
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  bus.put(0x185, {0xE2, 0x00});
  CHECK(bus.temp_degC() == Approx(22.6));
}

TEST_CASE("a TPDO on change becomes stale, or holds while heartbeats come", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.heartbeat_timeout_s = 2.0;
  const auto live = [](Bus& bus, int seconds, std::uint8_t state) {
    for (int i = 0; i < seconds; ++i) {
      bus.wait(1s);
      bus.put(0x705, {state});
    }
  };
  const auto age = [](const Bus& bus) { return bus.now - bus.line.readings()[0].taken_at; };
  SECTION("as it is: the text says what to do") {
    Bus bus(bus_of({node}));
    bus.put(0x185, {0xE1, 0x00});
    live(bus, 6, 0x05);
    CHECK(age(bus) == 6s);
    CHECK_THAT(bus.error(), Catch::Contains("COB-ID 0x185 is not received") &&
                                Catch::Contains("event timer") && Catch::Contains("pdo_on_change"));
    bus.put(0x185, {0xE1, 0x00});
    CHECK(bus.error().empty());
  }
  node.pdo_on_change = true;
  Bus bus(bus_of({node}));
  live(bus, 1, 0x05);
  CHECK(bus.fault() == Fault::no_answer);  // nothing has come yet
  bus.put(0x185, {0xE1, 0x00});
  live(bus, 20, 0x05);
  CHECK(age(bus) == 0s);
  CHECK(bus.temp_degC() == Approx(22.5));
  CHECK(bus.error().empty());
  SECTION("not while the node is not operational") {
    live(bus, 3, 0x7F);
    CHECK(age(bus) == 3s);
  }
  SECTION("not beyond the last heartbeat") {
    bus.wait(3s);
    CHECK(bus.fault() == Fault::no_answer);
  }
  SECTION("not beyond a reboot") {
    bus.put(0x705, {0x00});
    live(bus, 1, 0x05);
    CHECK(bus.fault() == Fault::no_answer);
  }
}

TEST_CASE("a stopped node is started again, once a second", "[canopen][node]") {
  Bus bus(bus_of({node_5({in_pdo(0, 0x185, 0)})}));
  bus.sent();
  bus.wait(1s);
  bus.put(0x705, {0x7F});
  bus.put(0x705, {0x7F});
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  bus.put(0x705, {0x05});
  bus.wait(1s);
  CHECK(bus.sent().empty());
}

TEST_CASE("a node that is not operational is named so", "[canopen][node]") {
  CanopenBusConfig config = bus_of({node_5({in_pdo(0, 0x185, 0)})});
  config.start_nodes = GENERATE(true, false);
  Bus bus(config);
  for (int i = 0; i < 6; ++i) {
    bus.wait(1s);
    bus.put(0x705, {0x7F});
  }
  CHECK_THAT(bus.error(), Catch::StartsWith("the node stays in the state pre-operational") &&
                              Catch::Contains(config.start_nodes ? "NMT start" : "start_nodes"));
  bus.put(0x085, {0x00, 0x62, 0x11, 0, 0, 0, 0, 0});
  CHECK_THAT(bus.error(), Catch::EndsWith("; emergency 0x6200 device software (register 0x11)"));
}

TEST_CASE("without start_nodes no NMT command is sent", "[canopen][node]") {
  CanopenBusConfig config = bus_of({node_5({in_pdo(0, 0x185, 0)})});
  config.start_nodes = false;
  Bus bus(config);
  bus.put(0x705, {0x00});
  bus.put(0x705, {0x7F});
  bus.wait(3s);
  CHECK(bus.sent().empty());
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.temp_degC() == Approx(22.5));
}

TEST_CASE("a lost heartbeat invalidates the readings until it is back", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.heartbeat_timeout_s = 0.5;
  Bus bus(bus_of({node}));
  bus.put(0x705, {0x05});
  bus.put(0x185, {0xE1, 0x00});
  bus.wait(400ms);
  CHECK(bus.fault() == Fault::none);
  bus.wait(200ms);
  CHECK(bus.fault() == Fault::no_answer);
  CHECK(bus.error() == "no heartbeat");
  bus.put(0x185, {0xE1, 0x00});  // its values alone are not enough
  CHECK(bus.fault() == Fault::no_answer);
  bus.sent();
  bus.put(0x705, {0x05});
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  CHECK(bus.fault() == Fault::no_answer);
  bus.put(0x185, {0xE2, 0x00});
  CHECK(bus.temp_degC() == Approx(22.6));
  CHECK(bus.error().empty());
}

TEST_CASE("settings are written before the start and verified", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.writes = {{{0x6110, 1}, {0x14, 0x00}}};
  Bus bus(bus_of({node}));
  CHECK(bus.sent() ==
        std::vector<Sent>{pre_operational_5, {0x605, {0x2B, 0x10, 0x61, 0x01, 0x14, 0, 0, 0}}});
  bus.put(0x185, {0xE1, 0x00});  // from a node still running with its old settings
  CHECK(bus.fault() == Fault::no_answer);
  bus.put(0x585, {0x60, 0x10, 0x61, 0x01, 0, 0, 0, 0});
  CHECK(bus.sent() == std::vector<Sent>{{0x605, {0x40, 0x10, 0x61, 0x01, 0, 0, 0, 0}}});
  SECTION("the same value") {
    bus.put(0x585, {0x4B, 0x10, 0x61, 0x01, 0x14, 0, 0, 0});
    CHECK(bus.sent() == std::vector<Sent>{start_5});
    bus.put(0x185, {0xE1, 0x00});
    CHECK(bus.temp_degC() == Approx(22.5));
  }
  SECTION("another value: no temperature, and a new try after a pause") {
    bus.put(0x585, {0x4B, 0x10, 0x61, 0x01, 0x15, 0, 0, 0});
    CHECK(bus.fault() == Fault::device_error);
    CHECK(bus.error() == "setting 6110:01: reads back 21 instead of 20");
    bus.put(0x185, {0xE1, 0x00});
    CHECK(bus.fault() == Fault::device_error);
    bus.wait(1100ms);
    CHECK(bus.sent().at(0) == pre_operational_5);
  }
}

TEST_CASE("a refused setting is reported with the name of its abort code", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.heartbeat_s = 1.0;
  Bus bus(bus_of({node}));
  CHECK(bus.sent().at(1).bytes == Bytes{0x2B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0});
  bus.put(0x585, {0x80, 0x17, 0x10, 0x00, 0x02, 0x00, 0x01, 0x06});
  CHECK(bus.sent() == std::vector<Sent>{{0x605, {0x40, 0x17, 0x10, 0x00, 0, 0, 0, 0}}});
  SECTION("no fault where the node has that value already") {
    bus.put(0x585, {0x4B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0});
    CHECK(bus.sent() == std::vector<Sent>{start_5});
    CHECK(bus.error().empty());
    return;
  }
  bus.put(0x585, {0x4B, 0x17, 0x10, 0x00, 0xF4, 0x01, 0, 0});
  CHECK(bus.fault() == Fault::device_error);
  CHECK(bus.error() ==
        "setting 1017:00: aborted by the node: 0x06010002 object is read only, and reads back 500 "
        "instead of 1000 ms: heartbeat_timeout_s without heartbeat_s sets nothing");
  bus.wait(600ms);
  CHECK(bus.sent().empty());
  SECTION("a reboot is a reason to try at once") {
    bus.put(0x705, {0x00});
    CHECK(bus.sent().size() == 2);
    CHECK(bus.fault() == Fault::no_answer);
  }
}

TEST_CASE("a missing node is retried with growing pauses", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.heartbeat_s = 1.0;
  Bus bus(bus_of({node}));
  int tries = 0;
  for (int s = 0; s < 120; ++s) {
    bus.wait(1s);
    for (const Sent& sent : bus.sent()) tries += sent.id == 0x605 && sent.bytes[0] == 0x2B ? 1 : 0;
    CHECK(bus.fault() == Fault::no_answer);
  }
  CHECK(tries > 8);
  CHECK(tries < 20);
  CHECK(bus.error() == "1017:00: no answer within sdo_timeout_s = 0.5");
}

TEST_CASE("mappings are read and objects found in them", "[canopen][node]") {
  CanopenNodeConfig node = node_5({object_channel(CanopenWay::pdo_object, {0x7130, 2})});
  node.mappings_read = {1};
  Bus bus(bus_of({node}));
  CHECK(bus.line.wanted().size() == 1);  // everything: the identifier is not known yet
  CHECK(bus.sent() == std::vector<Sent>{{0x605, {0x40, 0x00, 0x18, 0x01, 0, 0, 0, 0}}});
  const auto answer = [&](const Bytes& data) { bus.put(0x585, data); };
  SECTION("where they are") {
    answer({0x43, 0x00, 0x18, 0x01, 0x95, 0x01, 0x00, 0x40});  // 0x195, no RTR
    CHECK(bus.sent().at(0).bytes == Bytes{0x40, 0x00, 0x1A, 0x00, 0, 0, 0, 0});
    answer({0x4F, 0x00, 0x1A, 0x00, 2, 0, 0, 0});
    answer({0x43, 0x00, 0x1A, 0x01, 0x10, 0x01, 0x30, 0x71});  // 7130:01, 16 bits
    CHECK(bus.sent().at(1).bytes == Bytes{0x40, 0x00, 0x1A, 0x02, 0, 0, 0, 0});
    answer({0x43, 0x00, 0x1A, 0x02, 0x10, 0x02, 0x30, 0x71});
    CHECK(bus.sent() == std::vector<Sent>{start_5});
    bus.put(0x195, {0x11, 0x11, 0xE1, 0x00});
    CHECK(bus.temp_degC() == Approx(22.5));
  }
  SECTION("an object that is in none of them") {
    answer({0x43, 0x00, 0x18, 0x01, 0x95, 0x01, 0x00, 0x40});
    answer({0x4F, 0x00, 0x1A, 0x00, 1, 0, 0, 0});
    answer({0x43, 0x00, 0x1A, 0x01, 0x10, 0x01, 0x30, 0x71});
    CHECK(bus.fault() == Fault::device_error);
    CHECK(bus.error() == "7130:02 is in none of the node's TPDOs with 16 bits");
    bus.put(0x195, {0xE1, 0x00});
    CHECK(bus.fault() == Fault::device_error);
  }
  SECTION("a TPDO that is switched off") {
    answer({0x43, 0x00, 0x18, 0x01, 0x95, 0x01, 0x00, 0x80});
    CHECK(bus.fault() == Fault::device_error);
    CHECK(bus.error() == "TPDO 1 is switched off in the node");
  }
}

TEST_CASE("a mapping is read again when another master has had the node", "[canopen][node]") {
  CanopenNodeConfig node = node_5({object_channel(CanopenWay::pdo_object, {0x7130, 1})});
  node.mappings_read = {1};
  Bus bus(bus_of({node}));
  const auto map = [&](std::uint8_t sub, std::uint8_t second_sub) {
    bus.put(0x585, {0x43, 0x00, 0x18, 0x01, 0x85, 0x01, 0, 0});
    bus.put(0x585, {0x4F, 0x00, 0x1A, 0x00, 2, 0, 0, 0});
    bus.put(0x585, {0x43, 0x00, 0x1A, 0x01, 0x10, sub, 0x30, 0x71});
    bus.put(0x585, {0x43, 0x00, 0x1A, 0x02, 0x10, second_sub, 0x30, 0x71});
  };
  const Bytes values{0xE1, 0x00, 0xE2, 0x00};
  map(1, 2);
  bus.put(0x705, {0x7F});  // from before our start
  bus.put(0x705, {0x05});
  bus.put(0x185, values);
  CHECK(bus.temp_degC() == Approx(22.5));
  bus.wait(2s);
  bus.sent();
  bus.put(0x705, {0x7F});
  CHECK(bus.fault() == Fault::no_answer);
  CHECK_THAT(bus.error(), Catch::Contains("pre-operational by another master"));
  bus.put(0x185, values);  // started, before the heartbeat that shows it
  CHECK(bus.fault() == Fault::no_answer);
  CHECK(bus.sent().empty());  // the other master is not disturbed
  bus.wait(5s);
  bus.put(0x705, {0x7F});
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  bus.put(0x705, {0x05});
  CHECK(bus.sent().at(0) == Sent{0x605, {0x40, 0x00, 0x18, 0x01, 0, 0, 0, 0}});
  SECTION("exchanged") {
    map(2, 1);
    bus.put(0x185, values);
    CHECK(bus.temp_degC() == Approx(22.6));
  }
  SECTION("no longer mapped") {
    map(2, 3);
    bus.put(0x185, values);
    CHECK(bus.fault() == Fault::device_error);
  }
}

TEST_CASE("an object with another length than its type is not the configured one",
          "[canopen][node]") {
  std::vector<CanopenChannel> channels(1);
  channels[0].way = CanopenWay::pdo_object;
  channels[0].object = {0x2400, 1};
  channels[0].signal.length_bits = 16;
  CHECK(place_channels({0x181, {{{0x2400, 1}, 32}}}, channels).empty());
  CHECK(channels[0].signal.id == 0);
  const std::vector<std::size_t> placed =
      place_channels({0x182, {{{0x2400, 2}, 8}, {{0x2400, 1}, 16}}}, channels);
  CHECK(placed == std::vector<std::size_t>{0});
  CHECK(channels[0].signal.id == 0x182);
  CHECK(channels[0].signal.start_bit == 8);
}

TEST_CASE("a configured mapping needs no request", "[canopen][node]") {
  CanopenNodeConfig node = node_5({object_channel(CanopenWay::pdo_object, {0x7130, 2})});
  node.mappings = {{0x285, {{{0x0005, 0}, 8}, {{0x7130, 1}, 16}, {{0x7130, 2}, 16}}}};
  Bus bus(bus_of({node}));
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  bus.put(0x285, {0xFF, 0x11, 0x11, 0xE1, 0x00});
  CHECK(bus.temp_degC() == Approx(22.5));
  bus.put(0x285, {0xFF, 0x11, 0x11, 0xE1});
  CHECK(bus.fault() == Fault::bad_frame);
}

TEST_CASE("objects are polled, and each kind of failure is its own fault", "[canopen][node]") {
  CanopenNodeConfig node = node_5({object_channel(CanopenWay::sdo, {0x2040, 1})});
  Bus bus(bus_of({node}));
  const Bytes question{0x40, 0x40, 0x20, 0x01, 0, 0, 0, 0};
  CHECK(bus.sent() == std::vector<Sent>{start_5, {0x605, question}});
  bus.put(0x585, {0x4B, 0x40, 0x20, 0x01, 0xE1, 0x00, 0, 0});
  CHECK(bus.temp_degC() == Approx(22.5));
  bus.wait(1s);
  CHECK(bus.sent().at(0).bytes == question);
  SECTION("abort") {
    bus.put(0x585, {0x80, 0x40, 0x20, 0x01, 0x24, 0x00, 0x00, 0x08});
    CHECK(bus.fault() == Fault::device_error);
    CHECK(bus.error() == "2040:01: aborted by the node: 0x08000024 no data available");
  }
  SECTION("silence") {
    bus.wait(500ms);
    CHECK(bus.fault() == Fault::no_answer);
  }
  SECTION("too few bytes") {
    bus.put(0x585, {0x4F, 0x40, 0x20, 0x01, 0xE1, 0, 0, 0});
    CHECK(bus.fault() == Fault::bad_frame);
  }
  bus.sent();
  while (bus.sent().empty()) bus.wait(10ms);  // until it is polled again
  bus.put(0x585, {0x4B, 0x40, 0x20, 0x01, 0xE2, 0x00, 0, 0});
  CHECK(bus.temp_degC() == Approx(22.6));
  CHECK(bus.error().empty());
}

TEST_CASE("a polled value is accepted between two good statuses", "[canopen][node]") {
  CanopenChannel channel = object_channel(CanopenWay::sdo, {0x9130, 1});
  channel.status = {{0x6150, 1}, {{0, 8, ByteOrder::little_endian}, 0x07, {}}};
  channel.status->number.codes = {{3, Fault::out_of_range}};
  Bus bus(bus_of({node_5({channel})}));
  const auto value = [&] { bus.put(0x585, {0x4B, 0x30, 0x91, 0x01, 0xE1, 0x00, 0, 0}); };
  const auto status = [&](std::uint8_t number) {
    CHECK(bus.sent().back().bytes == Bytes{0x40, 0x50, 0x61, 0x01, 0, 0, 0, 0});
    bus.put(0x585, {0x4F, 0x50, 0x61, 0x01, number, 0, 0, 0});
  };
  value();
  CHECK(bus.fault() == Fault::no_answer);
  status(0x00);
  CHECK(bus.fault() == Fault::no_answer);  // the status before the value is unknown
  value();
  status(0x10);  // an unused bit
  CHECK(bus.temp_degC() == Approx(22.5));
  CHECK(bus.line.raw()[0].value == Bytes{0xE1, 0x00});
  CHECK(bus.line.raw()[0].status == Bytes{0x10});
  bus.wait(1s);
  value();
  CHECK(bus.temp_degC() == Approx(22.5));
  status(0x03);
  CHECK(bus.fault() == Fault::out_of_range);
  bus.wait(1s);
  value();
  status(0x00);
  CHECK(bus.fault() == Fault::out_of_range);
  value();
  status(0x00);
  CHECK(bus.temp_degC() == Approx(22.5));
  bus.wait(1s);
  value();
  status(0x01);  // an unlisted number
  CHECK(bus.fault() == Fault::device_error);
  bus.wait(1s);
  value();
  bus.wait(500ms);
  CHECK(bus.fault() == Fault::no_answer);
}

TEST_CASE("a JUMO CANtrans with a broken and a shorted thermocouple", "[canopen][node]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0), in_pdo(1, 0x185, 16)});
  node.emergency = EmergencyForm::jumo;
  node.channels[0].emergency_channel = 1;
  node.channels[1].emergency_channel = 2;
  Bus bus(bus_of({node}));
  CHECK(bus.sent().at(0).bytes == Bytes{0x40, 0x01, 0x10, 0x00, 0, 0, 0, 0});
  bus.put(0x585, {0x4F, 0x01, 0x10, 0x00, 0, 0, 0, 0});
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  bus.put(0x085, {0x30, 0x50, 0x01, 1, 0x01, 0, 0, 0});
  CHECK(bus.fault(0) == Fault::open_circuit);
  CHECK(bus.temp_degC(1) == Approx(22.6));
  bus.put(0x085, {0x30, 0x50, 0x01, 2, 0x02, 0, 0, 0});
  bus.put(0x185, {0xFF, 0x7F, 0xE2, 0x00});
  CHECK(bus.fault(0) == Fault::open_circuit);
  CHECK(bus.fault(1) == Fault::short_circuit);
  SECTION("the resets name their channel") {
    bus.put(0x085, {0, 0, 0, 2, 0, 0, 0, 0});
    bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
    CHECK(bus.fault(0) == Fault::open_circuit);
    CHECK(bus.temp_degC(1) == Approx(22.6));
  }
  SECTION("a reset that nobody heard is seen in the error register when the bus is back") {
    bus.line.closed(bus.now);
    CHECK(bus.fault(1) == Fault::no_answer);
    bus.line.opened(bus.now);
    bus.put(0x585, {0x4F, 0x01, 0x10, 0x00, 0, 0, 0, 0});
    bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
    CHECK(bus.fault(0) == Fault::none);
    CHECK(bus.fault(1) == Fault::none);
  }
  CHECK(bus.line.health(bus.now)[0].exceptions == 2);
}

// ------------------------------------------------------------------ duplicates

TEST_CASE("two nodes with one number are detected by their heartbeats", "[canopen][duplicate]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  node.heartbeat_s = 0.1;
  Bus bus(bus_of({node}));
  bus.put(0x585, {0x60, 0x17, 0x10, 0x00, 0, 0, 0, 0});
  bus.put(0x585, {0x4B, 0x17, 0x10, 0x00, 100, 0, 0, 0});
  const auto beat = [&](int a_period) {
    for (int i = 0; i < 20 * a_period; ++i) {
      bus.put(0x705, {0x05});
      bus.put(0x185, {0xE1, 0x00});
      bus.wait(100ms / a_period);
    }
  };
  beat(1);
  CHECK(bus.fault() == Fault::none);
  beat(2);
  CHECK(bus.fault() == Fault::device_error);
  CHECK(bus.error() == "two nodes answer as node 5");
  beat(1);
  CHECK(bus.temp_degC() == Approx(22.5));
  CHECK(bus.error().empty());
}

TEST_CASE("a TPDO at twice its rate gives no value", "[canopen][duplicate]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0), in_pdo(1, 0x285, 0)});
  node.pdo_period_s = 0.1;
  Bus bus(bus_of({node}));
  const auto run = [&](int a_period) {
    for (int i = 0; i < 20 * a_period; ++i) {
      bus.put(0x185, {0xE1, 0x00});
      if (i % a_period == 0) bus.put(0x285, {0xE2, 0x00});
      bus.wait(100ms / a_period);
    }
  };
  run(1);
  CHECK(bus.fault(0) == Fault::none);
  run(2);
  CHECK(bus.fault(0) == Fault::device_error);
  CHECK(bus.fault(1) == Fault::none);
  CHECK(bus.error() ==
        "COB-ID 0x185 is received too often: two nodes send it, or pdo_period_s is wrong");
  run(1);
  CHECK(bus.fault(0) == Fault::none);
}

TEST_CASE("two answers to one request are both refused", "[canopen][duplicate]") {
  CanopenNodeConfig node = node_5({object_channel(CanopenWay::sdo, {0x2040, 1})});
  Bus bus(bus_of({node}));
  const Bytes one{0x4B, 0x40, 0x20, 0x01, 0xE1, 0x00, 0, 0};
  bus.put(0x585, one);
  CHECK(bus.fault() == Fault::none);
  bus.put(0x585, {0x4B, 0x40, 0x20, 0x01, 0x10, 0x00, 0, 0});
  CHECK(bus.fault() == Fault::device_error);
  CHECK(bus.error() == "two nodes answer as node 5");
  for (int i = 0; i < 11; ++i) {
    bus.wait(1s);
    bus.put(0x585, one);
  }
  CHECK(bus.fault() == Fault::none);
}

TEST_CASE("two nodes that report the same COB-ID are both refused", "[canopen][duplicate]") {
  CanopenNodeConfig a = node_5({object_channel(CanopenWay::pdo_object, {0x7130, 1})});
  a.mappings_read = {1};
  CanopenNodeConfig b = a;
  b.name = "other";
  b.node = 6;
  Bus bus(bus_of({a, b}));
  const auto map = [&](std::uint32_t id, std::uint8_t cob_id) {
    bus.put(id, {0x43, 0x00, 0x18, 0x01, cob_id, 0x01, 0, 0});
    bus.put(id, {0x4F, 0x00, 0x1A, 0x00, 1, 0, 0, 0});
    bus.put(id, {0x43, 0x00, 0x1A, 0x01, 0x10, 0x01, 0x30, 0x71});
  };
  map(0x585, 0x85);
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.fault(0) == Fault::none);
  map(0x586, 0x85);
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.fault(0) == Fault::device_error);
  CHECK(bus.fault(1) == Fault::device_error);
  CHECK(bus.error(0) == "COB-ID 0x185 is sent by node 6 (other) too");
  bus.put(0x706, {0x00});  // repaired
  map(0x586, 0x86);
  bus.put(0x185, {0xE1, 0x00});
  bus.put(0x186, {0xE2, 0x00});
  CHECK(bus.fault(0) == Fault::none);
  CHECK(bus.temp_degC(1) == Approx(22.6));
}

// ------------------------------------------------------------------ the line

TEST_CASE("SYNC and our heartbeat keep their periods and skip missed ones", "[canopen][line]") {
  CanopenBusConfig config = bus_of({node_5({in_pdo(0, 0x185, 0)})});
  config.sync_s = 0.1;
  config.own_node = 127;
  config.heartbeat_s = 0.5;
  Bus bus(config);
  bus.sent();
  bus.wait(1s);
  int syncs = 0;
  int heartbeats = 0;
  for (const Sent& sent : bus.sent()) {
    syncs += sent == Sent{0x080, {}} ? 1 : 0;
    heartbeats += sent == Sent{0x77F, {0x05}} ? 1 : 0;
  }
  CHECK(syncs == 10);
  CHECK(heartbeats == 2);
  bus.now += 10s;  // the process was stopped
  bus.line.advance(bus.now);
  CHECK(bus.sent().size() == 2);
}

TEST_CASE("a lost bus invalidates every reading; set-up starts again", "[canopen][line]") {
  Bus bus(bus_of({node_5({in_pdo(0, 0x185, 0)})}));
  bus.put(0x185, {0xE1, 0x00});
  bus.line.closed(bus.now);
  CHECK(bus.fault() == Fault::no_answer);
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.fault() == Fault::no_answer);
  bus.sent();
  bus.line.opened(bus.now);
  CHECK(bus.sent() == std::vector<Sent>{start_5});
  bus.put(0x185, {0xE1, 0x00});
  CHECK(bus.fault() == Fault::none);
}

TEST_CASE("impossible node numbers are refused by name", "[canopen][line]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0)});
  CHECK_THROWS_AS(CanopenLine(bus_of({node, node})), InvalidValue);
  node.node = 128;
  CHECK_THROWS_AS(CanopenLine(bus_of({node})), InvalidValue);
  CanopenBusConfig config = bus_of({node_5({in_pdo(0, 0x185, 0)})});
  config.own_node = 5;
  CHECK_THROWS_AS(CanopenLine(config), InvalidValue);
}

TEST_CASE("only needed frames are received", "[canopen][line]") {
  const CanopenLine line(bus_of({node_5({in_pdo(0, 0x185, 0)})}));
  std::vector<std::uint32_t> ids;
  for (const CanFilter& filter : line.wanted()) ids.push_back(filter.id.id);
  CHECK(ids == std::vector<std::uint32_t>{0x085, 0x585, 0x705, 0x185});
}
