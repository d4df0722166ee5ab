/// The real Modbus link, TCP and RTU, with a device that answers anything: an exchange succeeds
/// only with its complete own answer, and always ends in time.
///
/// Input: properties of the line, then for each exchange the request and the pieces of the answer.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "common/fuzz.hpp"
#include "common/virtual_line.hpp"
#include "drivers/modbus/connection.hpp"

using namespace thermocomp;
using Bytes = std::vector<std::uint8_t>;

namespace {

constexpr std::uint16_t untouched = 0x5AA5;
constexpr int exchanges_max = 4;
constexpr double timeout_ms = 50.0;

void append_crc(Bytes& frame) {
  std::uint16_t crc = 0xFFFF;
  for (const std::uint8_t byte : frame) {
    crc = static_cast<std::uint16_t>(crc ^ byte);
    for (int bit = 0; bit < 8; ++bit) {
      crc = static_cast<std::uint16_t>((crc & 1) != 0 ? (crc >> 1) ^ 0xA001 : crc >> 1);
    }
  }
  frame.push_back(static_cast<std::uint8_t>(crc & 0xFF));
  frame.push_back(static_cast<std::uint8_t>(crc >> 8));
}

/// How input bytes become a piece of an answer.
enum class Wrapping : std::uint8_t { as_it_is, framed, framed_for_request, hang_up };

/// The device: answers from the input.
class Device {
 public:
  Device(fuzz::ByteFeed& feed, bool is_serial) : feed_(feed), is_serial_(is_serial) {}

  std::vector<fuzz::VirtualLine::Piece> answer(std::span<const std::uint8_t> request) {
    std::vector<fuzz::VirtualLine::Piece> pieces;
    const int count = feed_.u8() % 4;
    for (int i = 0; i < count; ++i) {
      const std::uint8_t head = feed_.u8();
      const auto wrapping = static_cast<Wrapping>(head & 3);
      constexpr std::array<int, 8> delays_ms{0, 1, 10, 49, 51, 120, 1000, 5000};
      fuzz::VirtualLine::Piece piece;
      piece.delay = std::chrono::milliseconds(delays_ms[head >> 2 & 7]);
      piece.bytes = wrapped(feed_.take(feed_.u8()), wrapping, request);
      piece.hang_up = wrapping == Wrapping::hang_up;
      // In two parts, so that a frame can also end in the middle of a read.
      if ((head & 0x80) != 0 && piece.bytes.size() > 1) {
        fuzz::VirtualLine::Piece second;
        const auto middle =
            piece.bytes.begin() + static_cast<std::ptrdiff_t>(piece.bytes.size() / 2);
        second.bytes.assign(middle, piece.bytes.end());
        piece.bytes.erase(middle, piece.bytes.end());
        std::swap(second.hang_up, piece.hang_up);
        second.delay = std::chrono::milliseconds((head & 0x40) != 0 ? 20 : 0);
        pieces.push_back(std::move(piece));
        pieces.push_back(std::move(second));
      } else {
        pieces.push_back(std::move(piece));
      }
    }
    return pieces;
  }

 private:
  Bytes wrapped(Bytes body, Wrapping wrapping, std::span<const std::uint8_t> request) const {
    if (wrapping == Wrapping::as_it_is || wrapping == Wrapping::hang_up) return body;
    const bool own = wrapping == Wrapping::framed_for_request;
    if (is_serial_) {
      if (own) body.insert(body.begin(), request.begin(), request.begin() + 2);  // unit, function
      append_crc(body);
      return body;
    }
    if (own) body.insert(body.begin(), request.begin() + 6, request.begin() + 8);
    Bytes frame{0,
                0,
                0,
                0,
                static_cast<std::uint8_t>(body.size() >> 8),
                static_cast<std::uint8_t>(body.size() & 0xFF)};
    if (own) std::copy_n(request.begin(), 2, frame.begin());  // its transaction
    frame.insert(frame.end(), body.begin(), body.end());
    return frame;
  }

  fuzz::ByteFeed& feed_;
  bool is_serial_;
};

struct Asked {
  int unit{1};
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};
  std::vector<std::uint16_t> words;
};

std::uint8_t function_of(ModbusTable table) {
  constexpr std::array<std::uint8_t, 4> functions{1, 2, 3, 4};  // order of the enumeration
  return functions[static_cast<std::size_t>(table)];
}

/// True if `part` arrived after the request; earlier data cannot answer it.
bool has_arrived(const fuzz::VirtualLine& line, const Bytes& part) {
  const std::span<const std::uint8_t> all = line.arrived_since_asked();
  return std::search(all.begin(), all.end(), part.begin(), part.end()) != all.end();
}

/// The only answer that makes this read succeed, without framing. Unused bits of the last byte are
/// arbitrary, so the last byte of bit reads is omitted.
Bytes expected_answer(const Asked& asked) {
  const bool bits = asked.table == ModbusTable::coil || asked.table == ModbusTable::discrete_input;
  const std::size_t count = asked.words.size();
  const std::size_t data_bytes = bits ? (count + 7) / 8 : 2 * count;
  Bytes answer{static_cast<std::uint8_t>(asked.unit), function_of(asked.table),
               static_cast<std::uint8_t>(data_bytes)};
  for (std::size_t i = 0; i < (bits ? data_bytes - 1 : 0); ++i) {
    unsigned byte = 0;
    for (std::size_t bit = 0; bit < 8; ++bit) byte |= unsigned{asked.words[8 * i + bit]} << bit;
    answer.push_back(static_cast<std::uint8_t>(byte));
  }
  for (std::size_t i = 0; i < (bits ? 0 : count); ++i) {
    answer.push_back(static_cast<std::uint8_t>(asked.words[i] >> 8));
    answer.push_back(static_cast<std::uint8_t>(asked.words[i] & 0xFF));
  }
  return answer;
}

void check_ended(const Exchange& exchange, nanoseconds began, const fuzz::VirtualLine& line) {
  const auto took = line.now() - began;
  // Pause after a late answer (6 s), timeout, draining, and the clock readings.
  FUZZ_REQUIRE(took <= std::chrono::milliseconds(7500));
  FUZZ_REQUIRE(exchange.ok() == (exchange.fault() == Fault::none));
  FUZZ_REQUIRE(exchange.ok() || !exchange.detail.empty());
  const bool is_exception = exchange.outcome == ExchangeOutcome::exception;
  FUZZ_REQUIRE(!is_exception || (exchange.exception_code >= 1 && exchange.exception_code <= 255));
  FUZZ_REQUIRE(is_exception || exchange.exception_code == 0);
  if (exchange.ok() || is_exception) {
    FUZZ_REQUIRE(exchange.arrived_at >= exchange.sent_at);
    FUZZ_REQUIRE(exchange.sent_at >= began);
  }
  FUZZ_REQUIRE(exchange.outcome != ExchangeOutcome::cancelled);
}

Exchange read_some(ModbusConnection& connection, fuzz::ByteFeed& feed,
                   const fuzz::VirtualLine& line, int unit) {
  Asked asked;
  asked.unit = unit;
  asked.table = static_cast<ModbusTable>(feed.u8() % 4);
  asked.address = feed.u16();
  asked.words.assign(std::size_t{1} + feed.u8() % 125, untouched);
  const Exchange exchange = connection.read(asked.unit, asked.table, asked.address, asked.words);
  if (!exchange.ok()) {
    FUZZ_REQUIRE(std::all_of(asked.words.begin(), asked.words.end(),
                             [](std::uint16_t word) { return word == untouched; }));
    return exchange;
  }
  FUZZ_REQUIRE(has_arrived(line, expected_answer(asked)));
  return exchange;
}

Exchange write_some(ModbusConnection& connection, fuzz::ByteFeed& feed,
                    const fuzz::VirtualLine& line, int unit) {
  const std::uint16_t address = feed.u16();
  std::vector<std::uint16_t> words(std::size_t{1} + feed.u8() % 123, 0x1234);
  const Exchange exchange = connection.write_registers(unit, address, words);
  if (exchange.ok()) {
    FUZZ_REQUIRE(has_arrived(
        line,
        {static_cast<std::uint8_t>(unit), 16, static_cast<std::uint8_t>(address >> 8),
         static_cast<std::uint8_t>(address & 0xFF), 0, static_cast<std::uint8_t>(words.size())}));
  }
  return exchange;
}

ModbusLine line_of(bool is_serial) {
  ModbusLine line;
  line.timeout_ms = timeout_ms;
  if (is_serial) {
    line.link = ModbusRtu{"/dev/null", 19200, 'E', 8, 1, false};
  } else {
    line.link = ModbusTcp{"127.0.0.1", 502};
  }
  return line;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  const bool is_serial = (feed.u8() & 1) != 0;
  Device device(feed, is_serial);
  fuzz::VirtualLine line(
      [&](std::span<const std::uint8_t> request) { return device.answer(request); });
  ModbusConnection connection(line_of(is_serial));
  std::vector<Exchange> ended;
  for (int i = 0; i < exchanges_max && !feed.empty(); ++i) {
    FUZZ_REQUIRE(connection.connect());
    const std::uint8_t what = feed.u8();
    const int unit = 1 + (what >> 2) % 4;
    const nanoseconds began = line.now();
    if ((what & 3) < 2) {
      ended.push_back(read_some(connection, feed, line, unit));
    } else {
      ended.push_back(write_some(connection, feed, line, unit));
    }
    check_ended(ended.back(), began, line);
  }
  // Details are static texts, unchanged after later exchanges.
  for (const Exchange& exchange : ended) {
    FUZZ_REQUIRE(exchange.ok() || !exchange.detail.empty());
  }
  return 0;
}
