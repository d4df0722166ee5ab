// SDO and EMCY, with the bytes of CiA 301 written by hand.
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "canopen_bus.hpp"
#include "drivers/can/canopen/emergency.hpp"
#include "drivers/can/canopen/sdo_client.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

TEST_CASE("SDO: an expedited read is one request and one answer", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x2040, 1}, 1s);
  CHECK(sent_by(client) == std::vector<Sent>{{0x605, {0x40, 0x40, 0x20, 0x01, 0, 0, 0, 0}}});
  SECTION("with its length") {
    client.take(Bytes{0x4B, 0x40, 0x20, 0x01, 0xE1, 0x00, 0x55, 0x55}, 1s);
    const auto result = client.result();
    REQUIRE(result);
    CHECK(result->outcome == SdoOutcome::done);
    CHECK(result->bytes == Bytes{0xE1, 0x00});
  }
  SECTION("without its length: four bytes") {
    client.take(Bytes{0x42, 0x40, 0x20, 0x01, 1, 2, 3, 4}, 1s);
    CHECK(client.result()->bytes == Bytes{1, 2, 3, 4});
  }
  CHECK_FALSE(client.busy());
  CHECK_FALSE(client.result());
}

TEST_CASE("SDO: a segmented read alternates its toggle bit", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x1008, 0}, 1s);
  sent_by(client);
  client.take(Bytes{0x41, 0x08, 0x10, 0x00, 9, 0, 0, 0}, 1s);
  CHECK(sent_by(client) == std::vector<Sent>{{0x605, {0x60, 0, 0, 0, 0, 0, 0, 0}}});
  client.take(Bytes{0x00, 'C', 'A', 'N', 't', 'r', 'a', 'n'}, 1s);
  CHECK(sent_by(client) == std::vector<Sent>{{0x605, {0x70, 0, 0, 0, 0, 0, 0, 0}}});
  SECTION("the last segment says how much of it is unused") {
    client.take(Bytes{0x1B, 's', 'T', 0, 0, 0, 0, 0}, 1s);
    const auto result = client.result();
    REQUIRE(result);
    CHECK(std::string(result->bytes.begin(), result->bytes.end()) == "CANtransT");
  }
  SECTION("a toggle that stands still is an abort") {
    client.take(Bytes{0x0B, 's', 'T', 0, 0, 0, 0, 0}, 1s);
    CHECK(client.result()->outcome == SdoOutcome::broken);
    CHECK(sent_by(client) ==
          std::vector<Sent>{{0x605, {0x80, 0x08, 0x10, 0x00, 0x00, 0x00, 0x03, 0x05}}});
  }
  SECTION("fewer bytes than announced are an abort") {
    client.take(Bytes{0x1D, 's', 0, 0, 0, 0, 0, 0}, 1s);
    CHECK(client.result()->outcome == SdoOutcome::broken);
  }
}

TEST_CASE("SDO: an answer may omit unused bytes, but no others", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  const auto answered = [&](const Bytes& answer) {
    client.cancel();
    client.read({0x2040, 1}, 1s);
    sent_by(client);
    client.take(answer, 1s);
    const auto result = client.result();
    REQUIRE(result);
    return *result;
  };
  CHECK(answered({0x4B, 0x40, 0x20, 0x01, 0xE1, 0x00}).bytes == Bytes{0xE1, 0x00});
  CHECK(answered({0x42, 0x40, 0x20, 0x01, 0xE1}).bytes == Bytes{0xE1});
  CHECK(to_string(answered({0x4B, 0x40, 0x20, 0x01, 0xE1})) ==
        "2040:01: not an answer to the request: 0x06070010 length does not match");
  CHECK(answered({0x42, 0x40, 0x20, 0x01}).outcome == SdoOutcome::broken);
  CHECK(answered({0x4B, 0x40}).outcome == SdoOutcome::broken);
  const SdoResult aborted = answered({0x80, 0x40, 0x20, 0x01, 0x11, 0x00, 0x09, 0x06});
  CHECK(aborted.outcome == SdoOutcome::aborted);

  client.write({0x1017, 0}, Bytes{0xE8, 0x03}, 1s);
  client.take(Bytes{0x60, 0x17, 0x10, 0x00}, 1s);
  CHECK(client.result()->outcome == SdoOutcome::done);

  client.read({0x1008, 0}, 1s);
  client.take(Bytes{0x41, 0x08, 0x10, 0x00, 2, 0, 0, 0}, 1s);
  client.take(Bytes{0x0B, 's', 'T'}, 1s);
  CHECK(client.result()->bytes == Bytes{'s', 'T'});
}

TEST_CASE("SDO: an announced size beyond the limit is refused", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x1008, 0}, 1s);
  sent_by(client);
  client.take(Bytes{0x41, 0x08, 0x10, 0x00, 0x01, 0x04, 0, 0}, 1s);
  CHECK(client.result()->abort_code == 0x05040005);
  CHECK(sent_by(client).at(0).bytes == Bytes{0x80, 0x08, 0x10, 0x00, 0x05, 0x00, 0x04, 0x05});
}

TEST_CASE("SDO: expedited writes state the number of bytes used", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.write({0x1017, 0}, Bytes{0xE8, 0x03}, 1s);
  CHECK(sent_by(client) == std::vector<Sent>{{0x605, {0x2B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0}}});
  client.take(Bytes{0x60, 0x17, 0x10, 0x00, 0, 0, 0, 0}, 1s);
  CHECK(client.result()->outcome == SdoOutcome::done);
  client.write({0x1800, 2}, Bytes{0x01}, 1s);
  CHECK(sent_by(client).at(0).bytes == Bytes{0x2F, 0x00, 0x18, 0x02, 0x01, 0, 0, 0});
  client.cancel();
  client.write({0x1800, 1}, Bytes{0x85, 0x01, 0, 0}, 1s);
  CHECK(sent_by(client).at(0).bytes == Bytes{0x23, 0x00, 0x18, 0x01, 0x85, 0x01, 0, 0});
}

TEST_CASE("SDO: an abort is reported by name", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x2040, 1}, 1s);
  client.take(Bytes{0x80, 0x40, 0x20, 0x01, 0x00, 0x00, 0x02, 0x06}, 1s);
  const auto result = client.result();
  REQUIRE(result);
  CHECK(result->outcome == SdoOutcome::aborted);
  CHECK(to_string(*result) == "2040:01: aborted by the node: 0x06020000 object does not exist");
  CHECK(sdo_abort_name(0x06090030) == "invalid value");
  CHECK(sdo_abort_name(0x12345678) == "unknown abort code");
}

TEST_CASE("SDO: a time-out ends a transfer, and the node is reported", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x2040, 1}, 1s);
  sent_by(client);
  client.advance(1s + 99ms);
  CHECK(client.busy());
  client.advance(1s + 100ms);
  CHECK(client.result()->outcome == SdoOutcome::timed_out);
  CHECK(sent_by(client).at(0).bytes == Bytes{0x80, 0x40, 0x20, 0x01, 0x00, 0x00, 0x04, 0x05});
  SECTION("a late answer is not taken for one to the next question") {
    client.read({0x2040, 2}, 2s);
    client.take(Bytes{0x4B, 0x40, 0x20, 0x01, 0xFF, 0x0F, 0, 0}, 2s);
    CHECK(client.busy());
    CHECK(client.second_answers() == 0);
  }
}

TEST_CASE("SDO: a second answer shows a second node", "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  client.read({0x2040, 1}, 1s);
  const Bytes answer{0x4B, 0x40, 0x20, 0x01, 0xE1, 0x00, 0, 0};
  client.take(answer, 1s);
  CHECK(client.second_answers() == 0);
  client.take(answer, 1s);
  CHECK(client.second_answers() == 1);
}

TEST_CASE("SDO: a write confirmed twice during its verification is not taken as the read's answer",
          "[canopen][sdo]") {
  SdoClient client(5, 100ms);
  const Bytes confirmed{0x60, 0x17, 0x10, 0x00, 0, 0, 0, 0};
  client.write({0x1017, 0}, Bytes{0xE8, 0x03}, 1s);
  client.take(confirmed, 1s);
  client.read({0x1017, 0}, 1s);
  client.take(confirmed, 1s);
  CHECK(client.busy());
  CHECK(client.second_answers() == 1);
  client.take(Bytes{0x4B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0}, 1s);
  CHECK(client.result()->outcome == SdoOutcome::done);
}

TEST_CASE("EMCY: code, register and the manufacturer's bytes", "[canopen][emergency]") {
  const auto emergency = read_emergency(Bytes{0x30, 0x50, 0x01, 0x02, 0x01, 0, 0, 0});
  REQUIRE(emergency);
  CHECK(to_string(*emergency) == "0x5030 device hardware (register 0x01)");
  CHECK_FALSE(read_emergency(Bytes{0x30, 0x50, 0x01}));

  CanopenChannel channel;
  channel.emergency_channel = 2;
  const auto jumo = [&](Bytes data) {
    return emergency_fault(*read_emergency(data), EmergencyForm::jumo, channel);
  };
  CHECK(jumo({0x30, 0x50, 0x01, 2, 0x01, 0, 0, 0}) == Fault::open_circuit);
  CHECK(jumo({0x30, 0x50, 0x01, 2, 0x02, 0, 0, 0}) == Fault::short_circuit);
  CHECK(jumo({0x30, 0x50, 0x01, 2, 0x10, 0, 0, 0}) == Fault::short_circuit);
  CHECK(jumo({0x30, 0x50, 0x01, 2, 0x44, 0, 0, 0}) == Fault::device_error);
  CHECK_FALSE(jumo({0x30, 0x50, 0x01, 1, 0x01, 0, 0, 0}));
  CHECK_FALSE(jumo({0x10, 0x81, 0x11, 2, 0x01, 0, 0, 0}));
  CHECK(jumo({0, 0, 0, 2, 0, 0, 0, 0}) == Fault::none);
  CHECK_FALSE(jumo({0, 0, 0, 1, 0, 0, 0, 0}));
  CHECK(jumo({0, 0, 0, 0, 0, 0, 0, 0}) == Fault::none);
}

TEST_CASE("EMCY: listed codes fault a channel until no error is left", "[canopen][emergency]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0), in_pdo(1, 0x185, 16)});
  node.channels[0].emergency_codes = {0x4210};
  Bus bus(bus_of({node}));
  bus.put(0x585, {0x4F, 0x01, 0x10, 0x00, 0, 0, 0, 0});  // error register: none
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  CHECK(bus.temp_degC(0) == Approx(22.5));
  bus.put(0x085, {0x10, 0x42, 0x09, 0, 0, 0, 0, 0});
  CHECK(bus.fault(0) == Fault::device_error);
  CHECK(bus.fault(1) == Fault::none);
  CHECK(bus.error() == "emergency 0x4210 temperature (register 0x09)");
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  CHECK(bus.fault(0) == Fault::device_error);
  bus.put(0x085, {0, 0, 0x01, 0, 0, 0, 0, 0});  // reset, but another error is left
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  CHECK(bus.fault(0) == Fault::device_error);
  bus.put(0x085, {0, 0, 0, 0, 0, 0, 0, 0});
  CHECK(bus.fault(0) == Fault::device_error);  // the old value does not return
  bus.put(0x185, {0xE3, 0x00, 0xE2, 0x00});
  CHECK(bus.temp_degC(0) == Approx(22.7));
  CHECK(bus.error().empty());
}

TEST_CASE("EMCY: an error register that is not empty at the set-up is an emergency unheard",
          "[canopen][emergency]") {
  CanopenNodeConfig node = node_5({in_pdo(0, 0x185, 0), in_pdo(1, 0x185, 16)});
  node.channels[0].emergency_codes = {0x5030};
  Bus bus(bus_of({node}));
  bus.put(0x585, {0x4F, 0x01, 0x10, 0x00, 0x09, 0, 0, 0});
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  CHECK(bus.fault(0) == Fault::device_error);
  CHECK(bus.fault(1) == Fault::none);
  CHECK_THAT(bus.error(), Catch::StartsWith("error register 1001:00 is 0x09"));
  SECTION("until a reset with an empty one") {
    bus.put(0x085, {0, 0, 0x01, 0, 0, 0, 0, 0});
    bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
    CHECK(bus.fault(0) == Fault::device_error);
    bus.put(0x085, {0, 0, 0, 0, 0, 0, 0, 0});
  }
  SECTION("until a reboot") {
    bus.put(0x705, {0x00});
    bus.put(0x585, {0x4F, 0x01, 0x10, 0x00, 0, 0, 0, 0});
  }
  bus.put(0x185, {0xE1, 0x00, 0xE2, 0x00});
  CHECK(bus.temp_degC(0) == Approx(22.5));
  CHECK(bus.error().empty());
}
