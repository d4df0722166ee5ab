#include <future>
#include <thread>

#include <catch2/catch.hpp>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/modbus/connection.hpp"
#include "modbus_peer.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

ModbusLine tcp_line(int port, double timeout_ms = 300.0) {
  ModbusLine line;
  line.link = ModbusTcp{"127.0.0.1", port};
  line.timeout_ms = timeout_ms;
  return line;
}
ModbusLine rtu_line(const std::string& device, double timeout_ms = 300.0) {
  ModbusLine line;
  line.link = ModbusRtu{device, 115200, 'N', 8, 1, false};
  line.timeout_ms = timeout_ms;
  return line;
}

using Words = std::vector<std::uint16_t>;

Exchange read_inputs(ModbusConnection& connection, int unit, int address, Words& words) {
  return connection.read(unit, ModbusTable::input, static_cast<std::uint16_t>(address), words);
}

/// Both kinds of line, for tests that run on both.
struct Lines {
  peer::TcpDevice tcp;
  peer::SerialLine serial;
  void handle(const peer::Handler& handler) {
    tcp.handle(handler);
    serial.handle(handler);
  }
  ModbusLine line(bool rtu) const { return rtu ? rtu_line(serial.device()) : tcp_line(tcp.port()); }
};

}  // namespace

TEST_CASE("registers and bits of every table are read, writes are confirmed", "[connection]") {
  Lines lines;
  const bool rtu = GENERATE(false, true);
  CAPTURE(rtu);
  ModbusConnection connection(lines.line(rtu));
  REQUIRE(connection.connect());
  Words words(3);
  for (const ModbusTable table : {ModbusTable::holding, ModbusTable::input}) {
    REQUIRE(connection.read(7, table, 20, words).ok());
    CHECK(words == Words{7020, 7021, 7022});
  }
  Words bits(11);
  for (const ModbusTable table : {ModbusTable::coil, ModbusTable::discrete_input}) {
    REQUIRE(connection.read(7, table, 1, bits).ok());
    CHECK(bits == Words{1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1});
  }
  Words many(125);
  REQUIRE(read_inputs(connection, 1, 0, many).ok());
  CHECK(many[124] == 1124);
  CHECK(connection.write_registers(7, 5, words).ok());
}

TEST_CASE("exceptions, silence and wrong answers are distinguished", "[connection]") {
  Lines lines;
  const bool rtu = GENERATE(false, true);
  CAPTURE(rtu);
  ModbusConnection connection(lines.line(rtu));
  REQUIRE(connection.connect());
  Words words(2);
  const auto outcome_of = [&](const peer::Handler& handler) {
    lines.handle(handler);
    REQUIRE(connection.connect());
    return read_inputs(connection, 3, 0, words);
  };

  const Exchange busy = outcome_of([](const auto& r) { return peer::exception(r, 6); });
  CHECK(busy.outcome == ExchangeOutcome::exception);
  CHECK(busy.fault() == Fault::device_busy);
  CHECK(busy.unit_answered());
  const Exchange refused = outcome_of([](const auto& r) { return peer::exception(r, 2); });
  CHECK(refused.fault() == Fault::device_error);
  const Exchange gateway = outcome_of([](const auto& r) { return peer::exception(r, 11); });
  CHECK(gateway.fault() == Fault::no_answer);
  CHECK_FALSE(gateway.unit_answered());

  const Exchange own = outcome_of([](const auto& r) { return peer::exception(r, 13); });
  const Exchange other = outcome_of([](const auto& r) { return peer::exception(r, 200); });
  CHECK(own.exception_code == 13);
  CHECK(other.exception_code == 200);
  CHECK_THAT(own.detail, Catch::Contains("not in the protocol"));
  const Exchange without_code = outcome_of([](const auto& r) { return peer::exception(r, 0); });
  CHECK(without_code.outcome == ExchangeOutcome::bad_frame);

  const Exchange silent = outcome_of([](const auto&) { return peer::Reply{}; });
  CHECK(silent.outcome == ExchangeOutcome::timeout);
  CHECK(silent.fault() == Fault::no_answer);

  const Exchange short_answer =
      outcome_of([](const auto&) { return peer::Reply{peer::registers_pdu(4, {1})}; });
  CHECK(short_answer.outcome == ExchangeOutcome::bad_frame);
  CHECK(short_answer.fault() == Fault::bad_frame);
  const Exchange other_function = outcome_of([](const auto&) {
    return peer::Reply{peer::registers_pdu(3, {1, 2})};
  });
  CHECK(other_function.outcome == ExchangeOutcome::bad_frame);
  const Exchange other_unit = outcome_of([](const auto&) {
    peer::Reply reply{peer::registers_pdu(4, {1, 2})};
    reply.unit = 9;
    return reply;
  });
  CHECK(other_unit.outcome == ExchangeOutcome::bad_frame);
  const Exchange broken_off = outcome_of([rtu](const auto&) {
    peer::Reply reply;
    reply.raw = rtu ? peer::Bytes{3, 4, 4, 0} : peer::Bytes{0, 9, 0, 0, 0, 7, 3, 4, 4};
    return reply;
  });
  CHECK(broken_off.outcome == ExchangeOutcome::bad_frame);

  CHECK(outcome_of(peer::correct).ok());
  CHECK(words == Words{3000, 3001});
}

TEST_CASE("a wrong checksum is a bad frame, and the line recovers", "[connection]") {
  peer::SerialLine serial([](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    reply.spoil_checksum = true;
    return reply;
  });
  ModbusConnection connection(rtu_line(serial.device()));
  REQUIRE(connection.connect());
  Words words(2);
  CHECK(read_inputs(connection, 3, 0, words).outcome == ExchangeOutcome::bad_frame);
  serial.handle(peer::correct);
  CHECK(read_inputs(connection, 3, 0, words).ok());
}

TEST_CASE("TCP: a late answer is not taken for the present one", "[connection][late]") {
  // The first request is answered late, during the second one of the same form.
  std::atomic<int> count{0};
  peer::TcpDevice device([&count](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    reply.delay = count++ == 0 ? 250ms : 100ms;
    return reply;
  });
  ModbusConnection connection(tcp_line(device.port(), 200.0));
  REQUIRE(connection.connect());
  Words words(2);
  CHECK(read_inputs(connection, 1, 10, words).outcome == ExchangeOutcome::timeout);
  REQUIRE(read_inputs(connection, 1, 50, words).ok());
  CHECK(words == Words{1050, 1051});
  CHECK(device.connections() == 1);
}

TEST_CASE("an answer that comes before its request is discarded", "[connection][early]") {
  const bool rtu = GENERATE(false, true);
  // The first answer is followed by one to the next request: unit 1, two registers.
  Lines lines;
  std::atomic<int> count{0};
  lines.handle([&](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    if (count++ != 0) return reply;
    const peer::Bytes forged = peer::registers_pdu(request.function, {4242, 4243});
    if (rtu) {
      for (const peer::Bytes& pdu : {reply.pdu, forged}) {
        peer::Bytes frame{1};
        frame.insert(frame.end(), pdu.begin(), pdu.end());
        const std::uint16_t sum = peer::crc(frame);
        frame.push_back(static_cast<std::uint8_t>(sum & 0xFF));
        frame.push_back(static_cast<std::uint8_t>(sum >> 8));
        reply.raw.insert(reply.raw.end(), frame.begin(), frame.end());
      }
    } else {
      for (const std::uint8_t transaction : {std::uint8_t{1}, std::uint8_t{2}}) {
        const peer::Bytes& pdu = transaction == 1 ? reply.pdu : forged;
        const auto size = static_cast<std::uint8_t>(pdu.size() + 1);
        const peer::Bytes head{0, transaction, 0, 0, 0, size, 1};
        reply.raw.insert(reply.raw.end(), head.begin(), head.end());
        reply.raw.insert(reply.raw.end(), pdu.begin(), pdu.end());
      }
    }
    return reply;
  });
  ModbusConnection connection(lines.line(rtu));
  REQUIRE(connection.connect());
  Words words(2);
  REQUIRE(read_inputs(connection, 1, 10, words).ok());
  CHECK(words == Words{1010, 1011});
  std::this_thread::sleep_for(50ms);
  REQUIRE(read_inputs(connection, 1, 50, words).ok());
  CHECK(words == Words{1050, 1051});
}

namespace {

struct LateUnit {
  int wrong{0};
  int answers_of_others{0};
};

/// Seven seconds with a unit whose answers are always late.
LateUnit ask_late_unit(std::chrono::milliseconds lateness) {
  peer::SerialLine serial([lateness](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    if (request.unit == 1) reply.delay = lateness;
    return reply;
  });
  ModbusConnection connection(rtu_line(serial.device(), 100.0));
  LateUnit seen;
  if (!connection.connect()) return seen;
  // Like the sensor source: the same request until it is answered, then the next one.
  int address = 10;
  const auto end = peer::steady_clock::now() + 7s;
  while (peer::steady_clock::now() < end) {
    Words words(2);
    if (connection.ready_at(1, ModbusTable::input, static_cast<std::uint16_t>(address), 2) <=
        monotonic_now()) {
      if (read_inputs(connection, 1, address, words).ok()) {
        if (words[0] != 1000 + address) ++seen.wrong;
        address += 10;
      }
    } else if (read_inputs(connection, 2, 500, words).ok()) {
      if (words != Words{2500, 2501}) ++seen.wrong;
      ++seen.answers_of_others;
    }
  }
  return seen;
}

}  // namespace

TEST_CASE("RTU: answers that are always late are never taken for those of another request",
          "[connection][late]") {
  std::vector<std::future<LateUnit>> lines;
  for (const auto lateness : {120ms, 400ms, 1300ms, 2500ms})
    lines.push_back(std::async(std::launch::async, ask_late_unit, lateness));
  for (auto& line : lines) {
    const LateUnit seen = line.get();
    CHECK(seen.wrong == 0);
    CHECK(seen.answers_of_others > 50);
  }
}

TEST_CASE("RTU: noise in place of an answer is refused, and the line recovers", "[connection]") {
  std::atomic<bool> rubbish{true};
  peer::SerialLine serial([&rubbish](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    if (rubbish) reply = {.raw = {0x55, 0x04, 0xFF, 0x00, 0x13}};
    return reply;
  });
  ModbusConnection connection(rtu_line(serial.device()));
  REQUIRE(connection.connect());
  Words words(2);
  CHECK_FALSE(read_inputs(connection, 3, 0, words).ok());
  rubbish = false;
  CHECK(peer::eventually([&] { return read_inputs(connection, 3, 0, words).ok(); }));
  CHECK(words == Words{3000, 3001});
}

TEST_CASE("RTU: the echo of the request and bytes before the answer are skipped", "[connection]") {
  std::atomic<bool> echoes{true};
  std::atomic<bool> is_silent{false};
  peer::SerialLine serial([&](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    if (request.function == 6) reply.pdu = request.pdu;
    if (!echoes) {
      reply.raw = {0x00, 0x00};
      return reply;
    }
    peer::Bytes echo{static_cast<std::uint8_t>(request.unit)};
    echo.insert(echo.end(), request.pdu.begin(), request.pdu.end());
    const std::uint16_t sum = peer::crc(echo);
    echo.push_back(static_cast<std::uint8_t>(sum & 0xFF));
    echo.push_back(static_cast<std::uint8_t>(sum >> 8));
    reply.raw = echo;
    if (is_silent) reply.pdu.clear();
    return reply;
  });
  ModbusConnection connection(rtu_line(serial.device(), 150.0));
  REQUIRE(connection.connect());
  Words words(2);
  REQUIRE(read_inputs(connection, 3, 0, words).ok());
  CHECK(words == Words{3000, 3001});
  CHECK(connection.write_registers(3, 5, words).ok());
  CHECK(connection.write_register(3, 5, 77).ok());
  // A request that only the adapter has received is not confirmed.
  is_silent = true;
  const Exchange written = connection.write_register(3, 5, 78);
  CHECK(written.outcome == ExchangeOutcome::timeout);
  CHECK_THAT(written.detail, Catch::Contains("received only the echo of the request"));
  is_silent = echoes = false;
  REQUIRE(peer::eventually([&] { return read_inputs(connection, 3, 0, words).ok(); }));
  CHECK(connection.write_register(3, 5, 79).ok());
}

TEST_CASE("bytes received in place of the answer are described", "[connection]") {
  Lines lines;
  const auto message = [&](bool rtu, const peer::Handler& handler) {
    lines.handle(handler);
    ModbusConnection connection(lines.line(rtu));
    REQUIRE(connection.connect());
    Words words(2);
    const Exchange exchange = read_inputs(connection, 3, 0, words);
    CHECK(exchange.outcome == ExchangeOutcome::bad_frame);
    return exchange.detail;
  };
  const auto of_unit_9 = [](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    reply.unit = 9;
    return reply;
  };
  for (const bool rtu : {false, true})
    CHECK_THAT(message(rtu, of_unit_9), Catch::Contains("unit 9 answered instead of unit 3"));
  const auto of_transaction_0 = [](const peer::Request&) {
    return peer::Reply{.raw = {0, 0, 0, 0, 0, 7, 3, 4, 4, 0, 1, 0, 2}};
  };
  CHECK_THAT(message(false, of_transaction_0), Catch::Contains("expected transaction 1, got 0") &&
                                                   Catch::Contains("ignore_transaction = true"));
  const auto wide = [](const peer::Request&) {
    return peer::Reply{peer::registers_pdu(4, {1, 2, 3, 4})};
  };
  for (const bool rtu : {false, true})
    CHECK_THAT(message(rtu, wide), Catch::Contains("expected 4 bytes of data, got 8") &&
                                       Catch::Contains("wide_registers = true"));
  const auto part = [](const peer::Request&) { return peer::Reply{.raw = {3, 4, 4, 0, 7}}; };
  CHECK_THAT(
      message(true, part),
      Catch::Contains("incomplete answer: 5 of 9 bytes (03 04 04 00 07) within timeout_ms = 300"));
}

TEST_CASE("any transaction id is accepted where so configured, late answers are not",
          "[connection][late]") {
  std::atomic<int> count{0};
  peer::TcpDevice device([&](const peer::Request& request) {
    const auto address = static_cast<std::uint8_t>(request.address);
    return peer::Reply{.delay = count++ == 1 ? 400ms : 0ms,
                       .raw = {0, 0, 0, 0, 0, 7, 1, 4, 4, 0, address, 0, address}};
  });
  ModbusLine line = tcp_line(device.port(), 150.0);
  line.ignore_transaction = true;
  ModbusConnection connection(line);
  REQUIRE(connection.connect());
  Words words(2);
  REQUIRE(read_inputs(connection, 1, 10, words).ok());
  CHECK(words == Words{10, 10});
  CHECK(read_inputs(connection, 1, 20, words).outcome == ExchangeOutcome::timeout);
  REQUIRE(read_inputs(connection, 1, 30, words).ok());
  CHECK(words == Words{30, 30});
}

TEST_CASE("a connection closed by the peer is a lost line, not a time-out", "[connection]") {
  peer::TcpDevice device([](const peer::Request&) {
    peer::Reply reply;
    reply.close = true;
    return reply;
  });
  ModbusConnection connection(tcp_line(device.port()));
  REQUIRE(connection.connect());
  Words words(1);
  CHECK(read_inputs(connection, 1, 0, words).outcome == ExchangeOutcome::disconnected);
  CHECK_FALSE(connection.connected());
  CHECK(read_inputs(connection, 1, 0, words).outcome == ExchangeOutcome::disconnected);
  device.handle(peer::correct);
  REQUIRE(connection.connect());
  CHECK(read_inputs(connection, 1, 0, words).ok());
}

TEST_CASE("a connection that is closed after an answer is reopened", "[connection]") {
  const int answers = GENERATE(1, 3);
  std::atomic<int> count{0};
  peer::TcpDevice device([&](const peer::Request& request) {
    peer::Reply reply = peer::correct(request);
    if (request.function == 6) reply.pdu = request.pdu;
    reply.close_after = ++count % answers == 0;
    return reply;
  });
  ModbusConnection connection(tcp_line(device.port()));
  REQUIRE(connection.connect());
  Words words(1);
  for (int i = 0; i < 12; ++i) CHECK(read_inputs(connection, 1, i, words).ok());
  CHECK(connection.links() == 1);
  CHECK(connection.breaks() == 4);  // three times it may have restarted, then it is a habit
  CHECK(connection.connects() >= static_cast<std::uint64_t>(12 / answers));
  std::this_thread::sleep_for(50ms);
  CHECK(connection.write_register(1, 0, 5).ok());  // nothing of it was sent before
}

TEST_CASE("TCP: two time-outs in a row end a connection that may be half open", "[connection]") {
  peer::TcpDevice device([](const peer::Request&) { return peer::Reply{}; });
  ModbusConnection connection(tcp_line(device.port(), 50.0));
  REQUIRE(connection.connect());
  Words words(1);
  CHECK(read_inputs(connection, 1, 0, words).outcome == ExchangeOutcome::timeout);
  CHECK(connection.connected());
  CHECK(read_inputs(connection, 1, 0, words).outcome == ExchangeOutcome::timeout);
  CHECK_FALSE(connection.connected());
}

TEST_CASE("cancel ends any wait at once", "[connection]") {
  Lines lines;
  lines.handle([](const peer::Request&) { return peer::Reply{}; });
  const bool rtu = GENERATE(false, true);
  CAPTURE(rtu);
  ModbusLine line = lines.line(rtu);
  line.timeout_ms = 60000.0;
  ModbusConnection connection(line);
  REQUIRE(connection.connect());
  std::thread canceller([&connection] {
    std::this_thread::sleep_for(50ms);
    connection.cancel();
  });
  Words words(1);
  CHECK(read_inputs(connection, 1, 0, words).outcome == ExchangeOutcome::cancelled);
  canceller.join();
  CHECK_FALSE(connection.pause_until(monotonic_now() + 60s));
  CHECK_FALSE(connection.connect());
}

TEST_CASE("a line that cannot be opened gives the reason", "[connection]") {
  ModbusConnection absent(rtu_line("/nonexistent/port"));
  CHECK_FALSE(absent.connect());
  CHECK(absent.last_error().find("/nonexistent/port") != std::string::npos);
  ModbusLine nobody = tcp_line(1);
  nobody.link = ModbusTcp{"no-such-host.invalid", 502};
  ModbusConnection unknown(nobody);
  CHECK_FALSE(unknown.connect());
  CHECK(unknown.last_error().find("no-such-host.invalid") != std::string::npos);
  peer::SerialLine serial;
  ModbusLine rs485 = rtu_line(serial.device());
  std::get<ModbusRtu>(rs485.link).rs485 = true;
  ModbusConnection without_rs485(rs485);
  CHECK_FALSE(without_rs485.connect());
  CHECK(without_rs485.last_error().find("RS-485") != std::string::npos);
}

TEST_CASE("a host name is resolved", "[connection]") {
  peer::TcpDevice device;
  ModbusLine line = tcp_line(device.port());
  line.link = ModbusTcp{"localhost", device.port()};
  ModbusConnection connection(line);
  if (!connection.connect()) WARN("localhost: " << connection.last_error());
  Words words(1);
  // Where "localhost" is ::1 first, without a server there, the reason must be given.
  CHECK((connection.connected() ? read_inputs(connection, 1, 4, words).ok()
                                : !connection.last_error().empty()));
}

TEST_CASE("impossible settings are refused before anything is opened", "[connection]") {
  const auto refused = [](const ModbusLine& line) {
    CHECK_THROWS_AS(ModbusConnection(line), DriverError);
  };
  ModbusLine line = rtu_line("/dev/null");
  std::get<ModbusRtu>(line.link).baud = 12345;  // libmodbus would silently use 9600
  refused(line);
  line = rtu_line("/dev/null");
  std::get<ModbusRtu>(line.link).parity = 'X';
  refused(line);
  line = rtu_line("/dev/null");
  std::get<ModbusRtu>(line.link).data_bits = 7;
  refused(line);
  refused(rtu_line(""));
  refused(tcp_line(0));
  refused(tcp_line(70000));
  refused(tcp_line(502, 0.0));
  refused(tcp_line(502, not_a_number));
}

TEST_CASE("frames are 3.5 characters apart, 1.75 ms above 19200 baud", "[connection]") {
  ModbusLine line = rtu_line("/dev/null");
  CHECK(inter_frame_delay(line) == 1750us);
  std::get<ModbusRtu>(line.link).baud = 9600;
  CHECK(inter_frame_delay(line) == std::chrono::nanoseconds(3645833));  // 35 bits
  std::get<ModbusRtu>(line.link).parity = 'E';
  CHECK(inter_frame_delay(line) == std::chrono::nanoseconds(4010417));  // 38.5 bits
  line.inter_frame_delay_ms = 8.0;
  CHECK(inter_frame_delay(line) == 8ms);
  CHECK(inter_frame_delay(tcp_line(502)) == 0ns);
}
