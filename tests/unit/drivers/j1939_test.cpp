// State machines of J1939, with identifiers and bytes of J1939-21, -71 and -81 written by hand.
#include <cstdint>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/can/j1939/j1939_line.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Bytes = std::vector<std::uint8_t>;

/// SPN 110, engine coolant temperature: PGN 65262, byte 1, 1 degC per bit, -40 degC.
J1939Parameter coolant() {
  J1939Parameter parameter;
  parameter.pgn = 65262;
  parameter.length_bits = 8;
  parameter.offset = -40.0;
  return parameter;
}

/// SPN 175, engine oil temperature 1: PGN 65262, bytes 3-4, 0.03125 degC per bit, -273 degC.
J1939Parameter oil() {
  J1939Parameter parameter;
  parameter.pgn = 65262;
  parameter.start_byte = 2;
  parameter.length_bits = 16;
  parameter.scale = 0.03125;
  parameter.offset = -273.0;
  return parameter;
}

Bytes oil_bytes(unsigned raw) {
  return {
      0xFF, 0xFF, static_cast<std::uint8_t>(raw), static_cast<std::uint8_t>(raw >> 8), 0xFF, 0xFF,
      0xFF, 0xFF};
}

J1939BusConfig bus_of(J1939Parameter parameter, std::optional<int> address = 0x80) {
  J1939BusConfig bus;
  bus.name = "bus";
  bus.interface = "vcan0";
  J1939NodeConfig node;
  node.name = "module";
  node.address = address;
  node.channels = {{0, parameter}};
  bus.nodes = {node};
  return bus;
}

struct Sent {
  std::uint32_t id{0};
  Bytes bytes;
  bool operator==(const Sent&) const = default;
};

struct Bus {
  explicit Bus(J1939BusConfig config) : line(std::move(config)) { line.opened(now); }
  void put(std::uint32_t id, const Bytes& data) {
    CanFrame frame;
    frame.id = {id, true};
    frame.size = data.size();
    std::copy(data.begin(), data.end(), frame.data.begin());
    frame.received_at = now;
    line.take(frame);
    line.advance(now);
  }
  std::vector<Sent> sent() {
    std::vector<Sent> sent;
    while (const auto frame = line.next_frame()) {
      CHECK(frame->id.extended);
      sent.push_back({frame->id.id, {frame->payload().begin(), frame->payload().end()}});
    }
    return sent;
  }
  [[nodiscard]] const Reading& reading() const { return line.readings()[0]; }
  [[nodiscard]] std::string error() const { return line.health(now)[0].last_error; }

  nanoseconds now{1000s};
  J1939Line line;
};

constexpr std::uint64_t name_a = 0x8000FF0012345678;
constexpr std::uint64_t name_b = 0x8000FF0087654321;
/// Request for all NAMEs, from the null address.
const Sent ask_for_names{0x18EAFFFE, {0x00, 0xEE, 0x00}};

Bytes name_bytes(std::uint64_t name) {
  Bytes bytes;
  for (int i = 0; i < 8; ++i) bytes.push_back(static_cast<std::uint8_t>(name >> (8 * i)));
  return bytes;
}

}  // namespace

TEST_CASE("identifiers are decoded and encoded", "[j1939]") {
  const J1939Id broadcast = read_identifier(0x18FEEE80);
  CHECK(broadcast.pgn == 65262);
  CHECK(broadcast.source == 0x80);
  CHECK(broadcast.destination == address_global);
  CHECK(broadcast.priority == 6);
  const J1939Id addressed = read_identifier(0x1CECF980);
  CHECK(addressed.pgn == 0xEC00);
  CHECK(addressed.destination == 0xF9);
  CHECK(addressed.priority == 7);
  CHECK(identifier(broadcast).id == 0x18FEEE80);
  CHECK(identifier(addressed).id == 0x1CECF980);
}

TEST_CASE("temperatures of the digital annex are decoded", "[j1939]") {
  CHECK(decode(oil_bytes(0x2500), oil()).value == Approx(23.0));
  CHECK(decode(oil_bytes(0x0000), oil()).value == Approx(-273.0));
  CHECK(decode(oil_bytes(0xFAFF), oil()).value == Approx(1734.96875));
  CHECK(decode(Bytes{63}, coolant()).value == Approx(23.0));
  CHECK(decode(Bytes{}, coolant()).fault == Fault::bad_frame);
}

TEST_CASE("indicator codes of 8, 16, 32 and other lengths are not temperatures", "[j1939]") {
  const auto fault = [](unsigned raw) { return decode(oil_bytes(raw), oil()).fault; };
  CHECK(fault(0xFE00) == Fault::device_error);
  CHECK(fault(0xFEFF) == Fault::device_error);
  CHECK(fault(0xFF00) == Fault::device_error);
  CHECK(fault(0xFFFF) == Fault::device_error);
  CHECK(fault(0xFB00) == Fault::out_of_range);
  CHECK(fault(0xFDFF) == Fault::out_of_range);
  CHECK(fault(0xFAFF) == Fault::none);

  J1939Parameter own = oil();
  own.error = Fault::open_circuit;
  own.not_available = Fault::no_answer;
  own.sentinels = {{0xFE01, Fault::short_circuit}};
  CHECK(decode(oil_bytes(0xFE00), own).fault == Fault::open_circuit);
  CHECK(decode(oil_bytes(0xFE01), own).fault == Fault::short_circuit);
  CHECK(decode(oil_bytes(0xFFFF), own).fault == Fault::no_answer);

  own = coolant();
  own.error = Fault::open_circuit;
  own.not_available = Fault::no_answer;
  CHECK(decode(Bytes{0xFE}, own).fault == Fault::open_circuit);
  CHECK(decode(Bytes{0xFF}, own).fault == Fault::no_answer);
  CHECK(decode(Bytes{0xFB}, own).fault == Fault::out_of_range);
  CHECK(decode(Bytes{0xFA}, own).value == Approx(210.0));

  own.length_bits = 32;
  CHECK(decode(Bytes{0, 0, 0, 0xFE}, own).fault == Fault::open_circuit);
  CHECK(decode(Bytes{0xFF, 0xFF, 0xFF, 0xFF}, own).fault == Fault::no_answer);
  CHECK(decode(Bytes{0, 0, 0, 0xFF}, own).fault == Fault::no_answer);
  CHECK(decode(Bytes{0xFF, 0xFF, 0xFF, 0xFA}, own).fault == Fault::none);

  own.length_bits = 10;
  own.start_bit = 2;
  CHECK(decode(Bytes{0xFC, 0x0F}, own).fault == Fault::no_answer);
  CHECK(decode(Bytes{0xF8, 0x0F}, own).fault == Fault::open_circuit);
  CHECK(decode(Bytes{0xF7, 0x0F}, own).value == Approx(1021.0 - 40.0));
}

TEST_CASE("impossible parameters are refused with their key", "[j1939]") {
  const auto key_of = [](const J1939Parameter& parameter) -> std::string {
    try {
      check(parameter);
    } catch (const InvalidValue& error) {
      return error.key();
    }
    return "";
  };
  CHECK(key_of(oil()).empty());
  J1939Parameter bad = oil();
  bad.pgn = 0x40000;
  CHECK(key_of(bad) == "pgn");
  bad.pgn = 0xEF01;  // addressed: the lowest byte is the destination
  CHECK(key_of(bad) == "pgn");
  bad = oil();
  bad.length_bits = 33;
  CHECK(key_of(bad) == "length_bits");
  bad = oil();
  bad.start_byte = 1784;
  CHECK(key_of(bad) == "start_byte");
}

TEST_CASE("only the device's own groups give its readings", "[j1939]") {
  Bus bus(bus_of(oil()));
  CHECK(bus.reading().fault == Fault::no_answer);
  bus.put(0x18FEEE81, oil_bytes(0x2500));
  bus.put(0x18FEEF80, oil_bytes(0x2500));
  CHECK(bus.reading().fault == Fault::no_answer);
  bus.put(0x0CFEEE80, oil_bytes(0x2500));  // another priority
  CHECK(bus.reading().temp_degC == Approx(23.0));
  CHECK(bus.reading().taken_at == bus.now);
  bus.put(0x18FEEE80, {0xFF, 0xFF, 0x00});
  CHECK(bus.reading().fault == Fault::bad_frame);
  CHECK(bus.error() == "message too short");
  CHECK(bus.sent() == std::vector<Sent>{ask_for_names});  // else it only listens
  bus.line.closed(bus.now);
  CHECK(bus.reading().fault == Fault::no_answer);
}

TEST_CASE("BAM: a group of several packets is assembled", "[j1939][transport]") {
  J1939Parameter parameter = oil();
  parameter.pgn = 0xFF10;
  parameter.start_byte = 8;  // in the second packet
  Bus bus(bus_of(parameter));
  const Bytes announce{32, 10, 0, 2, 0xFF, 0x10, 0xFF, 0x00};
  const Bytes first{1, 0, 1, 2, 3, 4, 5, 6};
  const Bytes second{2, 7, 0x00, 0x25, 0xFF, 0xFF, 0xFF, 0xFF};
  bus.put(0x1CECFF80, announce);
  bus.put(0x1CEBFF80, first);
  CHECK(bus.reading().fault == Fault::no_answer);
  SECTION("whole") {
    bus.put(0x1CEBFF80, second);
    CHECK(bus.reading().temp_degC == Approx(23.0));
  }
  SECTION("a packet is missing") {
    bus.put(0x1CEBFF80, {3, 7, 0x00, 0x25, 0xFF, 0xFF, 0xFF, 0xFF});
    bus.put(0x1CEBFF80, second);
    CHECK(bus.reading().fault == Fault::no_answer);
  }
  SECTION("another sender's packet between them") {
    bus.put(0x1CEBFF81, second);
    CHECK(bus.reading().fault == Fault::no_answer);
    bus.put(0x1CEBFF80, second);
    CHECK(bus.reading().temp_degC == Approx(23.0));
  }
  SECTION("the next packet is overdue") {
    bus.now += 800ms;
    bus.line.advance(bus.now);
    bus.put(0x1CEBFF80, second);
    CHECK(bus.reading().fault == Fault::no_answer);
  }
  SECTION("it is begun anew") {
    bus.put(0x1CECFF80, announce);
    bus.put(0x1CEBFF80, first);
    bus.put(0x1CEBFF80, second);
    CHECK(bus.reading().temp_degC == Approx(23.0));
  }
  CHECK(bus.sent() == std::vector<Sent>{ask_for_names});
}

TEST_CASE("BAM: the padding of the last packet is not content", "[j1939][transport]") {
  J1939Parameter parameter = oil();
  parameter.pgn = 0xFF10;
  parameter.start_byte = 8;  // bytes 9 and 10 of a group that has 9
  Bus bus(bus_of(parameter));
  bus.put(0x1CECFF80, {32, 9, 0, 2, 0xFF, 0x10, 0xFF, 0x00});
  bus.put(0x1CEBFF80, {1, 0, 1, 2, 3, 4, 5, 6});
  bus.put(0x1CEBFF80, {2, 7, 0x00, 0x25, 0xFF, 0xFF, 0xFF, 0xFF});
  CHECK(bus.reading().fault == Fault::bad_frame);
}

TEST_CASE("an inconsistent announcement begins no transfer", "[j1939][transport]") {
  TransportReceiver receiver({0xFF10});
  const J1939Id id = read_identifier(0x1CECFF80);
  receiver.take(id, Bytes{32, 10, 0, 3, 0xFF, 0x10, 0xFF, 0x00}, 1s);
  receiver.take(id, Bytes{32, 8, 0, 2, 0xFF, 0x10, 0xFF, 0x00}, 1s);
  receiver.take(id, Bytes{32, 0xFA, 0x06, 255, 0xFF, 0x10, 0xFF, 0x00}, 1s);  // 1786 bytes
  receiver.take(id, Bytes{32, 10, 0, 2, 0xFF, 0x11, 0xFF, 0x00}, 1s);         // not wanted
  CHECK(receiver.open_transfers() == 0);
  CHECK(receiver.failed() == 3);
}

TEST_CASE("RTS and CTS: a message sent to us is granted, received and acknowledged",
          "[j1939][transport]") {
  J1939Parameter parameter = oil();
  parameter.pgn = 0xEF00;
  parameter.start_byte = 15;
  J1939BusConfig config = bus_of(parameter);
  config.own_address = 0xF9;
  config.own_name = name_b;
  Bus bus(config);
  CHECK(bus.sent() ==
        std::vector<Sent>{{0x18EEFFF9, name_bytes(name_b)}, {0x18EAFFF9, ask_for_names.bytes}});
  // 17 bytes in 3 packets, at most 2 per grant.
  bus.put(0x1CECF980, {16, 17, 0, 3, 2, 0x00, 0xEF, 0x00});
  CHECK(bus.sent() == std::vector<Sent>{{0x1CEC80F9, {17, 2, 1, 0xFF, 0xFF, 0x00, 0xEF, 0x00}}});
  bus.put(0x1CEBF980, {1, 0, 1, 2, 3, 4, 5, 6});
  CHECK(bus.sent().empty());
  bus.put(0x1CEBF980, {2, 7, 8, 9, 10, 11, 12, 13});
  CHECK(bus.sent() == std::vector<Sent>{{0x1CEC80F9, {17, 1, 3, 0xFF, 0xFF, 0x00, 0xEF, 0x00}}});
  SECTION("to its end") {
    bus.put(0x1CEBF980, {3, 14, 0x00, 0x25, 0xFF, 0xFF, 0xFF, 0xFF});
    CHECK(bus.sent() == std::vector<Sent>{{0x1CEC80F9, {19, 17, 0, 3, 0xFF, 0x00, 0xEF, 0x00}}});
    CHECK(bus.reading().temp_degC == Approx(23.0));
  }
  SECTION("a packet twice: it is aborted") {
    bus.put(0x1CEBF980, {2, 7, 8, 9, 10, 11, 12, 13});
    CHECK(bus.sent() ==
          std::vector<Sent>{{0x1CEC80F9, {255, 7, 0xFF, 0xFF, 0xFF, 0x00, 0xEF, 0x00}}});
    CHECK(bus.reading().fault == Fault::no_answer);
  }
  SECTION("silence: it is aborted") {
    bus.now += 1300ms;
    bus.line.advance(bus.now);
    CHECK(bus.sent() ==
          std::vector<Sent>{{0x1CEC80F9, {255, 3, 0xFF, 0xFF, 0xFF, 0x00, 0xEF, 0x00}}});
  }
  SECTION("the sender aborts") {
    bus.put(0x1CECF980, {255, 3, 0xFF, 0xFF, 0xFF, 0x00, 0xEF, 0x00});
    bus.put(0x1CEBF980, {3, 14, 0x00, 0x25, 0xFF, 0xFF, 0xFF, 0xFF});
    CHECK(bus.reading().fault == Fault::no_answer);
  }
  SECTION("what is not wanted is refused") {
    bus.put(0x1CECF980, {16, 17, 0, 3, 2, 0x00, 0xD0, 0x00});
    CHECK(bus.sent().at(0).bytes == Bytes{255, 2, 0xFF, 0xFF, 0xFF, 0x00, 0xD0, 0x00});
  }
}

TEST_CASE("a device is found by its NAME at any address", "[j1939][claim]") {
  J1939BusConfig config = bus_of(oil(), std::nullopt);
  config.nodes[0].name_claimed = name_a;
  Bus bus(config);
  CHECK(bus.sent() == std::vector<Sent>{ask_for_names});
  bus.put(0x18FEEE80, oil_bytes(0x2500));
  CHECK(bus.reading().fault == Fault::no_answer);
  CHECK(bus.error() == "no device has claimed an address with its NAME yet");
  bus.put(0x18EEFF80, name_bytes(name_a));
  bus.put(0x18FEEE80, oil_bytes(0x2500));
  CHECK(bus.reading().temp_degC == Approx(23.0));
  SECTION("another address") {
    bus.put(0x18EEFF90, name_bytes(name_a));
    CHECK(bus.reading().fault == Fault::no_answer);
    bus.put(0x18FEEE80, oil_bytes(0x2500));
    CHECK(bus.reading().fault == Fault::no_answer);
    bus.put(0x18FEEE90, oil_bytes(0x2520));
    CHECK(bus.reading().temp_degC == Approx(24.0));
  }
  SECTION("somebody else at its address") {
    bus.put(0x18EEFF80, name_bytes(name_b));
    bus.put(0x18FEEE80, oil_bytes(0x2500));
    CHECK(bus.reading().fault == Fault::no_answer);
    CHECK(bus.error() == "address 0x80 was claimed by 0x8000FF0087654321");
    bus.put(0x18EEFF80, name_bytes(name_a));  // it defends its address
    bus.put(0x18FEEE80, oil_bytes(0x2500));
    CHECK(bus.reading().fault == Fault::device_error);
    bus.put(0x18EEFFFE, name_bytes(name_b));
    bus.put(0x18FEEE80, oil_bytes(0x2500));
    CHECK(bus.reading().temp_degC == Approx(23.0));
    CHECK(bus.error().empty());
  }
  SECTION("it could not claim any") {
    bus.put(0x18EEFFFE, name_bytes(name_a));
    CHECK(bus.reading().fault == Fault::no_answer);
    CHECK(bus.error() == "could not claim an address");
  }
}

TEST_CASE("a new NAME at a known address is reported", "[j1939][claim]") {
  Bus bus(bus_of(oil()));
  bus.put(0x18EEFF80, name_bytes(name_a));
  CHECK(bus.error().empty());
  bus.now += 10s;  // exchanged
  bus.put(0x18EEFF80, name_bytes(name_b));
  CHECK(bus.error() == "address 0x80: NAME changed from 0x8000FF0012345678 to 0x8000FF0087654321");
  bus.put(0x18FEEE80, oil_bytes(0x2500));
  CHECK(bus.reading().temp_degC == Approx(23.0));
}

TEST_CASE("a NAME that has left an address is no second sender", "[j1939][claim]") {
  Bus bus(bus_of(oil()));
  bus.put(0x18EEFF80, name_bytes(name_b));
  bus.put(0x18EEFFFE, name_bytes(name_b));
  bus.put(0x18EEFF80, name_bytes(name_a));
  bus.put(0x18FEEE80, oil_bytes(0x2500));
  CHECK(bus.reading().temp_degC == Approx(23.0));
}

TEST_CASE("two NAMEs in turn on one address are two senders", "[j1939][claim]") {
  Bus bus(bus_of(oil()));
  bus.put(0x18EEFF80, name_bytes(name_b));
  bus.put(0x18EEFF80, name_bytes(name_a));  // defended, and the other goes on
  const auto send = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      bus.now += 1s;
      bus.put(0x18FEEE80, oil_bytes(0x2500));
    }
  };
  send(60);
  CHECK(bus.reading().fault == Fault::device_error);
  CHECK_THAT(bus.error(), Catch::StartsWith("address 0x80 is claimed by 0x8000FF0087654321 and "
                                            "0x8000FF0012345678"));
  SECTION("until one of them claims another address") {
    bus.put(0x18EEFF81, name_bytes(name_b));
  }
  SECTION("until the address was silent") {
    bus.now += 31s;
  }
  send(1);
  CHECK(bus.reading().temp_degC == Approx(23.0));
  CHECK(bus.error().empty());
}

TEST_CASE("our address is announced on request, defended, and given up to a smaller NAME",
          "[j1939][claim]") {
  J1939BusConfig config = bus_of(oil());
  config.own_address = 0xF9;
  config.own_name = name_a;
  Bus bus(config);
  bus.sent();
  bus.put(0x18EAFF80, {0x00, 0xEE, 0x00});
  CHECK(bus.sent() == std::vector<Sent>{{0x18EEFFF9, name_bytes(name_a)}});
  bus.put(0x18EEFFF9, name_bytes(name_b));
  CHECK(bus.sent() == std::vector<Sent>{{0x18EEFFF9, name_bytes(name_a)}});
  CHECK(bus.line.own_address() == 0xF9);
  bus.put(0x18EEFFF9, name_bytes(name_a - 1));
  CHECK(bus.sent() == std::vector<Sent>{{0x18EEFFFE, name_bytes(name_a)}});
  CHECK_FALSE(bus.line.own_address());
  bus.put(0x1CECF980, {16, 17, 0, 3, 2, 0x00, 0xEF, 0x00});
  CHECK(bus.sent().empty());
}

TEST_CASE("the kernel filters for our groups only", "[j1939]") {
  Bus bus(bus_of(oil()));
  bool own_group = false;
  for (const CanFilter& filter : bus.line.wanted()) {
    own_group = own_group || (filter.id.id == 0x00FEEE80 && filter.mask == 0x03FFFFFF);
  }
  CHECK(own_group);
  CHECK(bus.line.wanted().size() == 5);
}
