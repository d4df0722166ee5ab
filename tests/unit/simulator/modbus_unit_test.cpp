// Tests of a simulated unit's bytes, with the Modbus specification's examples where available.
#include "simulator/devices/modbus_unit.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/modbus/modbus_codec.hpp"
#include "simulator/devices/modbus_frames.hpp"
#include "simulator/plant/seeded_noise.hpp"

using namespace thermocomp;
using Bytes = std::vector<std::uint8_t>;

namespace {

ModbusUnit small_unit() {
  ModbusUnit unit;
  unit.define(ModbusTable::holding, 107, 3, true);
  unit.set(ModbusTable::holding, 107, std::vector<std::uint16_t>{0x022B, 0x0000, 0x0064});
  unit.define(ModbusTable::input, 4, 1, false);
  unit.define(ModbusTable::discrete_input, 0, 10, false);
  unit.set(ModbusTable::discrete_input, 0, 1);
  unit.set(ModbusTable::discrete_input, 9, 1);
  unit.define(ModbusTable::coil, 0, 4, true);
  return unit;
}

}  // namespace

TEST_CASE("registers and bits are read as in the specification") {
  ModbusUnit unit = small_unit();
  CHECK(unit.answer(Bytes{3, 0, 0x6B, 0, 3}).pdu == Bytes{3, 6, 2, 0x2B, 0, 0, 0, 0x64});
  CHECK(unit.answer(Bytes{2, 0, 0, 0, 10}).pdu == Bytes{2, 2, 0x01, 0x02});
}

TEST_CASE("a write changes writable registers and nothing else") {
  ModbusUnit unit = small_unit();
  CHECK(unit.answer(Bytes{6, 0, 107, 0x12, 0x34}).pdu == Bytes{6, 0, 107, 0x12, 0x34});
  CHECK(unit.word(ModbusTable::holding, 107) == 0x1234);
  const auto many = unit.answer(Bytes{16, 0, 107, 0, 2, 4, 0, 1, 0, 2});
  CHECK(many.pdu == Bytes{16, 0, 107, 0, 2});
  CHECK(many.wrote);
  CHECK(unit.word(ModbusTable::holding, 108) == 2);
  CHECK(unit.answer(Bytes{15, 0, 0, 0, 3, 1, 0b101}).pdu == Bytes{15, 0, 0, 0, 3});
  CHECK(unit.answer(Bytes{1, 0, 0, 0, 4}).pdu == Bytes{1, 1, 0b0101});
  CHECK(unit.answer(Bytes{5, 0, 0, 0, 0}).wrote);
  CHECK(unit.answer(Bytes{1, 0, 0, 0, 4}).pdu == Bytes{1, 1, 0b0100});
}

TEST_CASE("an invalid request is refused with the matching exception") {
  ModbusUnit unit = small_unit();
  const std::vector<std::pair<Bytes, int>> refused{
      {{0x2B, 14, 1, 0}, 1},                   // unknown function
      {{3, 0, 106, 0, 1}, 2},                  // before the first register
      {{3, 0, 107, 0, 4}, 2},                  // beyond the last
      {{3, 0xFF, 0xFF, 0, 125}, 2},            // beyond the table
      {{4, 0, 107, 0, 1}, 2},                  // in another table
      {{3, 0, 107, 0, 0}, 3},                  // nothing
      {{3, 0, 107, 0, 126}, 3},                // too much
      {{3, 0, 107, 0}, 3},                     // too short
      {{5, 0, 0, 0x12, 0}, 3},                 // neither on nor off
      {{6, 0, 110, 0, 1}, 2},                  // not writable
      {{16, 0, 107, 0, 2, 3, 0, 1, 0}, 3},     // counts disagree
      {{16, 0, 109, 0, 2, 4, 0, 1, 0, 1}, 2},  // partly beyond the last
  };
  for (const auto& [request, code] : refused) {
    const auto answer = unit.answer(request);
    CHECK(answer.pdu ==
          Bytes{static_cast<std::uint8_t>(request[0] | 0x80), static_cast<std::uint8_t>(code)});
    CHECK_FALSE(answer.wrote);
  }
}

TEST_CASE("values are encoded in registers in every encoding and word order") {
  const auto encoding =
      GENERATE(Encoding::int16, Encoding::int32, Encoding::float32, Encoding::float64);
  const auto order = GENERATE(WordOrder::abcd, WordOrder::dcba, WordOrder::badc, WordOrder::cdab);
  const ModbusValue place{ModbusTable::input, 8, encoding, order, 0.01};
  ModbusUnit unit;
  unit.define(place, false);
  unit.set_value(place, 0.0, -12.34);
  CHECK(unit.value(place) == Approx(-12.34).epsilon(1e-6));
  unit.set_value(place, 0.0, NAN);  // no code: as in burn-out
  if (encoding == Encoding::float32 || encoding == Encoding::float64) {
    CHECK(std::isnan(unit.value(place)));
  } else {
    CHECK(unit.value(place) == Approx(encoding == Encoding::int16 ? 327.67 : 21474836.47));
  }
  unit.set_code(place, 9999);
  CHECK(unit.value(place) == Approx(99.99));
}

TEST_CASE("the words of a float32 are in the configured order") {
  const ModbusValue place{ModbusTable::input, 0, Encoding::float32, WordOrder::cdab, 1.0};
  ModbusUnit unit;
  unit.define(place, false);
  unit.set_value(place, 0.0, 123.456);  // 0x42F6E979
  CHECK(unit.word(ModbusTable::input, 0) == 0xE979);
  CHECK(unit.word(ModbusTable::input, 1) == 0x42F6);
}

TEST_CASE("the CRC equals that of other implementations") {
  CHECK(modbus_crc(Bytes{0x01, 0x03, 0x00, 0x00, 0x00, 0x0A}) == 0xCDC5);
}

TEST_CASE("requests are found in streams regardless of segmentation") {
  const Bytes pdu{3, 0, 1, 0, 2};
  const Bytes tcp = make_tcp_frame(0x1234, 9, pdu);
  const Bytes rtu = make_rtu_frame(9, pdu);
  for (std::size_t cut = 0; cut < tcp.size(); ++cut) {
    CHECK(find_tcp_frame(std::span(tcp).first(cut)).state == FrameState::incomplete);
  }
  for (std::size_t cut = 0; cut < rtu.size(); ++cut) {
    CHECK(find_rtu_frame(std::span(rtu).first(cut), false).state == FrameState::incomplete);
  }
  const ModbusFrame found = find_tcp_frame(tcp);
  CHECK(found.state == FrameState::complete);
  CHECK(found.transaction == 0x1234);
  CHECK(found.unit == 9);
  CHECK(Bytes(found.pdu.begin(), found.pdu.end()) == pdu);
  const ModbusFrame serial = find_rtu_frame(rtu, false);
  CHECK(serial.state == FrameState::complete);
  CHECK(Bytes(serial.pdu.begin(), serial.pdu.end()) == pdu);
}

TEST_CASE("a serial request with a flipped bit is never accepted") {
  const Bytes good = make_rtu_frame(1, Bytes{6, 0, 1, 0, 2});
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
    CHECK(find_rtu_frame(bad, true).state == FrameState::broken);
  }
}

TEST_CASE("arbitrary bytes break neither a unit nor the framing") {
  ModbusUnit unit = small_unit();
  for (std::uint64_t seed = 0; seed < 20000; ++seed) {
    Bytes bytes(1 + seeded_bits(seed, 1, 0) % 300);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::uint8_t>(seeded_bits(seed, 2, i));
    }
    if (seed % 2 == 0) bytes[0] = static_cast<std::uint8_t>(bytes[0] % 17);
    CHECK(unit.answer(bytes).pdu.size() >= 2);
    const ModbusFrame tcp = find_tcp_frame(bytes);
    CHECK(tcp.length <= bytes.size());
    const ModbusFrame rtu = find_rtu_frame(bytes, true);
    CHECK(rtu.length <= bytes.size());
  }
}
