// Data block of an S7 CPU behind the interface of a Modbus line: the bytes of both sides, and a
// server with arbitrary answers.
#include <deque>
#include <random>

#include <catch2/catch.hpp>

#include "drivers/modbus/connection.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Bytes = std::vector<std::uint8_t>;

const Bytes confirmed{3,    0, 0,  22,   17, 0xD0, 0, 1,    0, 9, 0,
                      0xC0, 1, 10, 0xC1, 2,  3,    0, 0xC2, 2, 3, 1};
Bytes granted(std::uint8_t pdu_bytes = 240) {
  return {3, 0, 0, 27, 2, 0xF0, 0x80, 0x32, 3, 0, 0, 0, 0,        0,
          8, 0, 0, 0,  0, 0xF0, 0,    0,    1, 0, 1, 0, pdu_bytes};
}

/// TCP port below it: each request takes the next of the scripted answers. Its clock advances
/// during waits, and a little with each byte string received.
class Server final : public ModbusPort {
 public:
  explicit Server(std::deque<Bytes> script) : script_(std::move(script)) {}
  std::vector<Bytes>* sent{nullptr};
  Bytes endless;  ///< repeated once the script is over

  [[nodiscard]] nanoseconds now() const noexcept override { return clock_; }
  bool open(std::string& /*why*/) override { return true; }
  void close() noexcept override { there_.clear(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override {
    if (sent != nullptr) sent->emplace_back(bytes.begin(), bytes.end());
    if (script_.empty()) return true;
    there_.insert(there_.end(), script_.front().begin(), script_.front().end());
    script_.pop_front();
    return true;
  }
  PortWait wait_for_input(nanoseconds deadline) noexcept override {
    if (there_.empty() && script_.empty())
      there_.insert(there_.end(), endless.begin(), endless.end());
    if (!there_.empty()) return PortWait::ready;
    clock_ = std::max(clock_, deadline);
    return PortWait::late;
  }
  PortBytes receive(std::span<std::uint8_t> into) noexcept override {
    clock_ += 1ms;
    const std::size_t size = std::min({into.size(), there_.size(), std::size_t{7}});
    for (std::size_t i = 0; i < size; ++i, there_.pop_front()) into[i] = there_.front();
    return {size > 0 ? PortBytes::Kind::bytes : PortBytes::Kind::nothing, size};
  }
  bool pause_until(nanoseconds time) noexcept override {
    clock_ = std::max(clock_, time);
    return true;
  }
  void cancel() noexcept override {}
  [[nodiscard]] bool cancelled() const noexcept override { return false; }

 private:
  std::deque<Bytes> script_;
  std::deque<std::uint8_t> there_;
  nanoseconds clock_{1h};
};

ModbusLine line_to_db(int db) {
  ModbusLine line;
  ModbusTcp tcp{"127.0.0.1"};
  tcp.s7 = S7Block{db, 0, 1};
  line.link = tcp;
  return line;
}

/// A connection to DB 100 with a server that gives these answers.
struct Link {
  explicit Link(std::deque<Bytes> script, const Bytes& endless = {}) {
    auto server = std::make_unique<Server>(std::move(script));
    server->sent = &sent;
    server->endless = endless;
    const S7Block block{100, 0, 1};
    connection = std::make_unique<ModbusConnection>(line_to_db(100),
                                                    make_s7_port(block, std::move(server), 200ms));
  }
  Exchange read(std::span<std::uint16_t> words, std::uint16_t address = 4) const {
    return connection->read(1, ModbusTable::data_block, address, words);
  }
  std::vector<Bytes> sent;
  std::unique_ptr<ModbusConnection> connection;
};

}  // namespace

TEST_CASE("words of a data block are read and written as its bytes", "[s7]") {
  Link link({confirmed,
             granted(),
             {3, 0, 0, 29, 2, 0xF0, 0x80, 0x32, 3, 0,  0,    0,    1,    0,   2,
              0, 8, 0, 0,  4, 1,    0xFF, 4,    0, 32, 0x12, 0x34, 0x56, 0x78},
             {3, 0, 0, 22, 2, 0xF0, 0x80, 0x32, 3, 0, 0, 0, 2, 0, 2, 0, 1, 0, 0, 5, 1, 0xFF}});
  REQUIRE(link.connection->connect());
  std::array<std::uint16_t, 2> words{};
  REQUIRE(link.read(words).ok());
  CHECK(words == std::array<std::uint16_t, 2>{0x1234, 0x5678});
  REQUIRE(link.connection->write_registers(1, 3, std::array<std::uint16_t, 1>{0xABCD}).ok());
  REQUIRE(link.sent.size() == 4);
  CHECK(link.sent[0] ==
        Bytes{3, 0, 0, 22, 17, 0xE0, 0, 0, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, 3, 0, 0xC2, 2, 3, 1});
  CHECK(link.sent[2] == Bytes{3, 0, 0, 31,   2,  0xF0, 0x80, 0x32, 1, 0, 0,   0,    1, 0, 14, 0,
                              0, 4, 1, 0x12, 10, 0x10, 2,    0,    4, 0, 100, 0x84, 0, 0, 64});
  CHECK(link.sent[3] == Bytes{3,   0,    0, 37, 2,  0xF0, 0x80, 0x32, 1,    0,    0,   0, 2,
                              0,   14,   0, 6,  5,  1,    0x12, 10,   0x10, 2,    0,   2, 0,
                              100, 0x84, 0, 0,  48, 0,    4,    0,    16,   0xAB, 0xCD});
}

TEST_CASE("a refusal of the CPU is reported with its remedy", "[s7]") {
  const auto refused = [](std::uint8_t code) {
    Link link({confirmed, granted(), {3, 0, 0, 22, 2, 0xF0, 0x80, 0x32, 3, 0, 0,
                                      0, 1, 0, 2,  0, 1,    0,    0,    4, 1, code}});
    REQUIRE(link.connection->connect());
    std::array<std::uint16_t, 1> words{};
    const Exchange exchange = link.read(words);
    CHECK(exchange.outcome == ExchangeOutcome::exception);
    CHECK(exchange.unit_answered());  // 0x0A is no gateway exception 10
    return exchange.detail;
  };
  CHECK_THAT(refused(0x03), Catch::Contains("0x03") && Catch::Contains("permit PUT/GET"));
  CHECK_THAT(refused(0x05), Catch::Contains("0x05") && Catch::Contains("DB100 is shorter"));
  CHECK_THAT(refused(0x0A), Catch::Contains("0x0A") && Catch::Contains("Optimized block access"));
  CHECK_THAT(refused(0x06), Catch::Contains("0x06"));
}

TEST_CASE("a CPU that accepts no connection is reported", "[s7]") {
  const auto why = [](std::deque<Bytes> script) {
    const Link link(std::move(script));
    CHECK_FALSE(link.connection->connect());
    return link.connection->last_error();
  };
  CHECK_THAT(why({{3, 0, 0, 11, 6, 0x80, 0, 0, 0, 1, 1}}),
             Catch::Contains("rack 0, slot 1") && Catch::Contains("reason 1"));
  CHECK_THAT(why({Bytes{'H', 'T', 'T', 'P'}}), Catch::Contains("not ISO-on-TCP (48 54 54 50"));
  CHECK_THAT(why({}), Catch::Contains("no answer"));
  CHECK_THAT(why({confirmed}), Catch::Contains("does not begin (no answer)"));
  CHECK_THAT(why({confirmed, granted(112)}), Catch::Contains("PDUs of 112 bytes"));
}

TEST_CASE("an endless stream of unrelated frames ends in time", "[s7]") {
  const Bytes fragment{3, 0, 0, 8, 2, 0xF0, 0, 0x32};
  const Bytes of_another{3,    0, 0, 22, 2, 0xF0, 0x80, 0x32, 3, 0, 0,
                         0x77, 1, 0, 2,  0, 1,    0,    0,    4, 1, 5};
  const Bytes begins{3, 0, 4, 0, 2};
  for (const Bytes& endless : {fragment, of_another, begins}) {
    const Link link({confirmed, granted()}, endless);
    REQUIRE(link.connection->connect());
    std::array<std::uint16_t, 1> words{};
    const nanoseconds begun = link.connection->now();
    CHECK_FALSE(link.read(words).ok());
    CHECK(link.connection->now() - begun < 2s);
  }
}

TEST_CASE("for any bytes from a server, an exchange ends and gives no value", "[s7]") {
  std::mt19937 random(7);
  const auto any = [&](int below) {
    return static_cast<std::size_t>(random() % static_cast<unsigned>(below));
  };
  for (int run = 0; run < 3000; ++run) {
    Bytes answer{3, 0, 0, 29, 2, 0xF0, 0x80, 0x32, 3, 0,  0,    0,    1,    0,   2,
                 0, 8, 0, 0,  4, 1,    0xFF, 4,    0, 32, 0x12, 0x34, 0x56, 0x78};
    constexpr std::size_t data_at = 25;
    for (std::size_t changes = 1 + any(3); changes > 0; --changes)
      answer[any(data_at)] = static_cast<std::uint8_t>(random());
    if (any(2) == 0) answer.resize(any(30));
    const Link link({confirmed, granted(), answer});
    REQUIRE(link.connection->connect());
    std::array<std::uint16_t, 2> words{0x5AA5, 0x5AA5};
    const nanoseconds begun = link.connection->now();
    const Exchange exchange = link.read(words);
    CHECK(link.connection->now() - begun < 2s);
    // Unchecked bytes may have changed: an ok answer is the one sent.
    if (exchange.ok())
      CHECK(words == std::array<std::uint16_t, 2>{0x1234, 0x5678});
    else
      CHECK(words == std::array<std::uint16_t, 2>{0x5AA5, 0x5AA5});
  }
}
