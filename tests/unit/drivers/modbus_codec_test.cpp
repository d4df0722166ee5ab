#include "drivers/modbus/modbus_codec.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

using namespace thermocomp;
using Words = std::vector<std::uint16_t>;

namespace {

double value_of(const Words& words, Encoding encoding, WordOrder order = WordOrder::abcd,
                double scale = 1.0, double offset = 0.0) {
  const Decoded decoded = decode(words, {encoding, order, scale, offset}, {});
  REQUIRE(decoded.fault == Fault::none);
  return decoded.value;
}

constexpr std::array<WordOrder, 4> all_orders{WordOrder::abcd, WordOrder::dcba, WordOrder::badc,
                                              WordOrder::cdab};

}  // namespace

TEST_CASE("16-bit registers are decoded in both byte orders, signed and unsigned", "[codec]") {
  // 0xFF38 = -200 = 65336; bytes swapped 0x38FF
  CHECK(value_of({0xFF38}, Encoding::int16) == -200.0);
  CHECK(value_of({0xFF38}, Encoding::int16, WordOrder::cdab) == -200.0);
  CHECK(value_of({0x38FF}, Encoding::int16, WordOrder::badc) == -200.0);
  CHECK(value_of({0x38FF}, Encoding::int16, WordOrder::dcba) == -200.0);
  CHECK(value_of({0xFF38}, Encoding::uint16) == 65336.0);
  CHECK(value_of({0x38FF}, Encoding::uint16, WordOrder::dcba) == 65336.0);
}

TEST_CASE("32-bit values are decoded in all four word orders", "[codec]") {
  // 0x01020304 = 16909060; 0xFFFEFDFC = -66052 = 4294901244
  CHECK(value_of({0x0102, 0x0304}, Encoding::uint32, WordOrder::abcd) == 16909060.0);
  CHECK(value_of({0x0403, 0x0201}, Encoding::uint32, WordOrder::dcba) == 16909060.0);
  CHECK(value_of({0x0201, 0x0403}, Encoding::uint32, WordOrder::badc) == 16909060.0);
  CHECK(value_of({0x0304, 0x0102}, Encoding::uint32, WordOrder::cdab) == 16909060.0);
  CHECK(value_of({0xFFFE, 0xFDFC}, Encoding::int32, WordOrder::abcd) == -66052.0);
  CHECK(value_of({0xFCFD, 0xFEFF}, Encoding::int32, WordOrder::dcba) == -66052.0);
  CHECK(value_of({0xFEFF, 0xFCFD}, Encoding::int32, WordOrder::badc) == -66052.0);
  CHECK(value_of({0xFDFC, 0xFFFE}, Encoding::int32, WordOrder::cdab) == -66052.0);
  CHECK(value_of({0xFFFE, 0xFDFC}, Encoding::uint32) == 4294901244.0);
  // 23.4375f = 0x41BB8000
  CHECK(value_of({0x41BB, 0x8000}, Encoding::float32, WordOrder::abcd) == 23.4375);
  CHECK(value_of({0x0080, 0xBB41}, Encoding::float32, WordOrder::dcba) == 23.4375);
  CHECK(value_of({0xBB41, 0x0080}, Encoding::float32, WordOrder::badc) == 23.4375);
  CHECK(value_of({0x8000, 0x41BB}, Encoding::float32, WordOrder::cdab) == 23.4375);
}

TEST_CASE("64-bit values are decoded in all four word orders", "[codec]") {
  // pi = 0x400921FB54442D18
  const double pi = 3.141592653589793;
  CHECK(value_of({0x4009, 0x21FB, 0x5444, 0x2D18}, Encoding::float64, WordOrder::abcd) == pi);
  CHECK(value_of({0x182D, 0x4454, 0xFB21, 0x0940}, Encoding::float64, WordOrder::dcba) == pi);
  CHECK(value_of({0x0940, 0xFB21, 0x4454, 0x182D}, Encoding::float64, WordOrder::badc) == pi);
  CHECK(value_of({0x2D18, 0x5444, 0x21FB, 0x4009}, Encoding::float64, WordOrder::cdab) == pi);
}

TEST_CASE("scale and offset are applied after decoding", "[codec]") {
  CHECK(value_of({235}, Encoding::int16, WordOrder::abcd, 0.1) == Approx(23.5));
  CHECK(value_of({2962}, Encoding::uint16, WordOrder::abcd, 0.1, -273.15) == Approx(23.05));
}

TEST_CASE("sentinels are faults, and their neighbours are values", "[codec]") {
  const std::vector<Sentinel> adam{{0, Fault::short_circuit}, {0xFFFF, Fault::open_circuit}};
  const NumberFormat unsigned_16{Encoding::uint16};
  CHECK(decode(Words{0x0000}, unsigned_16, adam).fault == Fault::short_circuit);
  CHECK(decode(Words{0xFFFF}, unsigned_16, adam).fault == Fault::open_circuit);
  CHECK(std::isnan(decode(Words{0xFFFF}, unsigned_16, adam).value));
  CHECK(decode(Words{0xFFFE}, unsigned_16, adam).value == 65534.0);
  CHECK(decode(Words{0x0001}, unsigned_16, adam).value == 1.0);

  // PM6RTD: 32768 as an unsigned register, -32767 as a signed one
  CHECK(decode(Words{0x8000}, unsigned_16, std::vector<Sentinel>{{32768, Fault::open_circuit}})
            .fault == Fault::open_circuit);
  const std::vector<Sentinel> modmux{{-32767, Fault::out_of_range}};
  CHECK(decode(Words{0x8001}, {Encoding::int16}, modmux).fault == Fault::out_of_range);
  CHECK(decode(Words{0x8002}, {Encoding::int16}, modmux).value == -32766.0);
  CHECK(decode(Words{0x8001}, unsigned_16, modmux).value == 32769.0);

  // +9999 as a float, low word first: 0x461C3C00
  const std::vector<Sentinel> high{{9999, Fault::open_circuit}};
  CHECK(decode(Words{0x3C00, 0x461C}, {Encoding::float32, WordOrder::cdab}, high).fault ==
        Fault::open_circuit);
}

TEST_CASE("a sentinel is compared with the raw value, before scale and offset", "[codec]") {
  const std::vector<Sentinel> codes{{32767, Fault::open_circuit}};
  const NumberFormat tenths{Encoding::int16, WordOrder::abcd, 0.1, 5.0};
  CHECK(decode(Words{0x7FFF}, tenths, codes).fault == Fault::open_circuit);
}

TEST_CASE("a non-finite number is out of range, never a value", "[codec]") {
  CHECK(decode(Words{0x7FC0, 0}, {Encoding::float32}, {}).fault == Fault::out_of_range);  // NaN
  CHECK(decode(Words{0x7F80, 0}, {Encoding::float32}, {}).fault == Fault::out_of_range);  // inf
  CHECK(decode(Words{0xFFF0, 0, 0, 0}, {Encoding::float64}, {}).fault == Fault::out_of_range);
  CHECK(std::isnan(decode(Words{0x7F80, 0}, {Encoding::float32}, {}).value));
  const NumberFormat overflowing{Encoding::float64, WordOrder::abcd, 1e10};
  CHECK(decode(Words{0x7FE0, 0, 0, 0}, overflowing, {}).fault == Fault::out_of_range);
}

TEST_CASE("a status word is a fault unless it is listed as good, or 0 where nothing is",
          "[codec]") {
  ModbusStatus status{ModbusTable::holding, 0, 0x000F, {{1, Fault::open_circuit}}};
  CHECK(decode_status(status, 0x0000) == Fault::none);
  CHECK(decode_status(status, 0xABC0) == Fault::none);
  CHECK(decode_status(status, 0x0001) == Fault::open_circuit);
  CHECK(decode_status(status, 0x0002) == Fault::device_error);
  // With listed good codes, only those are good.
  status.codes = {{1, Fault::none}};
  CHECK(decode_status(status, 0) == Fault::device_error);
  CHECK(decode_status(status, 1) == Fault::none);
  status.codes = {{0, Fault::stale}, {2, Fault::none}};
  CHECK(decode_status(status, 0) == Fault::stale);
  CHECK(decode_status(status, 2) == Fault::none);
  const ModbusStatus bit{ModbusTable::discrete_input, 0, 0x0000, {{1, Fault::open_circuit}}};
  CHECK(decode_status(bit, 1) == Fault::open_circuit);
  CHECK(decode_status(bit, 0) == Fault::none);
}

TEST_CASE("encoding saturates at the ends and reports it", "[codec]") {
  const NumberFormat hundredths{Encoding::int16, WordOrder::abcd, 0.01};
  const Encoded inside = encode(-1.234, hundredths);
  CHECK(inside.result == EncodeResult::exact);
  CHECK(inside.registers[0] == 0xFF85);  // -123
  CHECK(inside.value == Approx(-1.23));
  CHECK(encode(327.67, hundredths).result == EncodeResult::exact);
  const Encoded above = encode(400.0, hundredths);
  CHECK(above.result == EncodeResult::saturated);
  CHECK(above.registers[0] == 0x7FFF);
  CHECK(above.value == Approx(327.67));
  CHECK(encode(-1e300, hundredths).registers[0] == 0x8000);
  CHECK(encode(-0.02, {Encoding::uint16, WordOrder::abcd, 0.01}).result == EncodeResult::saturated);
  CHECK(encode(1e300, {Encoding::float32}).result == EncodeResult::saturated);
  CHECK(encode(1e300, {Encoding::float64}).result == EncodeResult::exact);
}

TEST_CASE("a non-finite number is never written", "[codec]") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double value : {not_a_number, infinity, -infinity}) {
    const Encoded encoded = encode(value, {Encoding::int32});
    CHECK(encoded.result == EncodeResult::refused);
    CHECK(encoded.words().empty());
  }
  CHECK(encode(1.0, {Encoding::int16, WordOrder::abcd, 0.0}).result == EncodeResult::refused);
}

TEST_CASE("an encoded value decodes to the same value in every encoding and order", "[codec]") {
  const std::array<Encoding, 6> encodings{Encoding::int16,  Encoding::uint16,  Encoding::int32,
                                          Encoding::uint32, Encoding::float32, Encoding::float64};
  for (const Encoding encoding : encodings) {
    for (const WordOrder order : all_orders) {
      for (const double value : {0.0, 1.0, 258.0, 12345.0, 32767.0}) {
        const Encoded encoded = encode(value, {encoding, order});
        REQUIRE(encoded.count == registers_of(encoding));
        CHECK(decode(encoded.words(), {encoding, order}, {}).value == value);
        CHECK(encoded.value == value);
      }
    }
  }
  CHECK(encode(-66052.0, {Encoding::int32, WordOrder::cdab}).registers[0] == 0xFDFC);
}

TEST_CASE("a code that cannot occur in the encoding is recognised", "[codec]") {
  CHECK(is_representable(-32768, Encoding::int16));
  CHECK_FALSE(is_representable(32768, Encoding::int16));
  CHECK_FALSE(is_representable(-1, Encoding::uint16));
  CHECK(is_representable(4294967295, Encoding::uint32));
  CHECK(is_representable(9999, Encoding::float32));
  CHECK_FALSE(is_representable(16777217, Encoding::float32));
  // 2^53 + 1 is not exact in a double either; 2^63 - 1 is rounded to 2^63, which is no code.
  constexpr std::int64_t between = (std::int64_t{1} << 53) + 1;
  constexpr std::int64_t greatest = std::numeric_limits<std::int64_t>::max();
  for (const Encoding encoding : {Encoding::float32, Encoding::float64}) {
    CHECK_FALSE(is_representable(between, encoding));
    CHECK_FALSE(is_representable(greatest, encoding));
    CHECK(is_representable(std::numeric_limits<std::int64_t>::min(), encoding));
  }
}
