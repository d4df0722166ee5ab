// Frames written by hand from the DBC numbering, then random ones.
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;

namespace {

using Frame = std::array<std::uint8_t, 8>;

CanSignal intel(int start, int length, bool is_signed = false) {
  CanSignal signal;
  signal.start_bit = start;
  signal.length_bits = length;
  signal.byte_order = ByteOrder::little_endian;
  signal.is_signed = is_signed;
  return signal;
}

CanSignal motorola(int start, int length, bool is_signed = false) {
  CanSignal signal = intel(start, length, is_signed);
  signal.byte_order = ByteOrder::big_endian;
  return signal;
}

struct HandComputed {
  const char* what;
  Frame frame;
  CanSignal signal;
  double value;
};

CanSignal scaled(CanSignal signal, double scale, double offset) {
  signal.scale = scale;
  signal.offset = offset;
  return signal;
}

CanSignal floating(CanSignal signal) {
  signal.is_float = true;
  return signal;
}

const std::vector<HandComputed>& hand_computed() {
  static const std::vector<HandComputed> frames{
      {"Intel, 8 bits, byte 0", {0xAB}, intel(0, 8), 0xAB},
      {"Intel, 16 bits, bytes 0-1", {0x34, 0x12}, intel(0, 16), 0x1234},
      // 22.5 degC at 0.1 degC per count = 225 = 0x00E1
      {"Intel, 16 bits signed scaled",
       {0, 0, 0xE1, 0x00},
       scaled(intel(16, 16, true), 0.1, 0.0),
       225 * 0.1},
      // -5.5 degC = -55 = 0xFFC9
      {"Intel, 16 bits negative",
       {0, 0, 0xC9, 0xFF},
       scaled(intel(16, 16, true), 0.1, 0.0),
       -55 * 0.1},
      // 12 bits from bit 4: high nibble of byte 0 = 0xC, byte 1 = 0xAB -> 0xABC
      {"Intel, 12 bits across bytes", {0xC0, 0xAB}, intel(4, 12), 0xABC},
      {"Intel, 12 bits across bytes, negative", {0xE0, 0xFF}, intel(4, 12, true), -2},
      {"Intel, one bit", {0x00, 0x20}, intel(13, 1), 1},
      {"Intel, one signed bit", {0x00, 0x20}, intel(13, 1, true), -1},
      {"Motorola, 8 bits, byte 3", {0, 0, 0, 0x5A}, motorola(31, 8), 0x5A},
      {"Motorola, 16 bits, bytes 0-1", {0x12, 0x34}, motorola(7, 16), 0x1234},
      {"Motorola, 16 bits negative", {0xFF, 0xC9}, motorola(7, 16, true), -55},
      // 12 bits from bit 3: bits 3..0 of byte 0 = 0xA, all of byte 1 = 0xBC -> 0xABC
      {"Motorola, 12 bits: low nibble, then a byte", {0xFA, 0xBC}, motorola(3, 12), 0xABC},
      // 12 bits from bit 7: all of byte 0 = 0xAB, then bits 15..12 = 0xC -> 0xABC
      {"Motorola, 12 bits: a byte, then the high nibble", {0xAB, 0xCF}, motorola(7, 12), 0xABC},
      // 12 bits from bit 13: bits 13..8 = 0b101010, then bits 23..18 = 0b111100 -> 0xABC
      {"Motorola, 12 bits: six and six", {0, 0b11'101010, 0b111100'11}, motorola(13, 12), 0xABC},
      {"Motorola, 12 bits negative", {0xFF, 0xEF}, motorola(7, 12, true), -2},
      // 24 bits with an offset: 0x000FA0 = 4000 -> 4000 * 0.01 - 40 = 0
      {"Motorola, 24 bits with offset",
       {0, 0x00, 0x0F, 0xA0},
       scaled(motorola(15, 24), 0.01, -40),
       4000 * 0.01 - 40},
      {"Intel, 64 bits signed",
       {0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF},
       intel(0, 64, true),
       -2},
      {"Motorola, 64 bits unsigned", {0, 0, 0, 0, 0, 0, 0x01, 0x02}, motorola(7, 64), 258},
      // IEEE 754: 25.5f = 0x41CC0000, 25.5 = 0x4039800000000000
      {"Intel, float", {0, 0, 0, 0, 0x00, 0x00, 0xCC, 0x41}, floating(intel(32, 32)), 25.5},
      {"Motorola, float", {0x41, 0xCC, 0x00, 0x00}, floating(motorola(7, 32)), 25.5},
      {"Intel, double", {0, 0, 0, 0, 0, 0x80, 0x39, 0x40}, floating(intel(0, 64)), 25.5},
      {"Motorola, double", {0x40, 0x39, 0x80}, floating(motorola(7, 64)), 25.5},
  };
  return frames;
}

/// A random signal that fits into `bytes`, any order, length and sign.
CanSignal random_signal(std::mt19937_64& random, int bytes = 8) {
  const auto below = [&random](int n) {
    return std::uniform_int_distribution<int>(0, n - 1)(random);
  };
  const int length = 1 + below(64);
  const int first = below(8 * bytes - length + 1);
  CanSignal signal = below(2) == 0 ? intel(first, length) : motorola(0, length);
  if (signal.byte_order == ByteOrder::big_endian) signal.start_bit = first / 8 * 8 + 7 - first % 8;
  signal.is_signed = below(2) == 0;
  signal.fd = bytes > 8;
  return signal;
}

Frame random_frame(std::mt19937_64& random) {
  return std::bit_cast<Frame>(random());
}

/// The value of a signal, read bit by bit by the definition of the numbering.
std::uint64_t read_bit_by_bit(std::span<const std::uint8_t> frame, const CanSignal& signal) {
  std::uint64_t raw = 0;
  int bit = signal.start_bit;
  for (int i = 0; i < signal.length_bits; ++i) {
    const auto here = static_cast<std::size_t>(bit);
    const std::uint64_t one = (unsigned{frame[here / 8]} >> (here % 8)) & 1u;
    if (signal.byte_order == ByteOrder::little_endian) {
      raw |= one << i;
      ++bit;
    } else {
      raw = (raw << 1) | one;
      bit = bit % 8 == 0 ? bit + 15 : bit - 1;
    }
  }
  return raw;
}

}  // namespace

TEST_CASE("a CAN signal is decoded as computed by hand", "[can]") {
  for (const HandComputed& example : hand_computed()) {
    CAPTURE(example.what);
    REQUIRE_NOTHROW(check(example.signal));
    const CanValue decoded = decode(example.frame, example.signal);
    CHECK(decoded.fault == Fault::none);
    CHECK(decoded.value == example.value);
  }
}

TEST_CASE("a CAN value is written to exactly its own bits", "[can]") {
  for (const HandComputed& example : hand_computed()) {
    CAPTURE(example.what);
    const std::uint64_t own = bits_of(example.signal).to_ullong();
    for (const std::uint8_t background : {std::uint8_t{0x00}, std::uint8_t{0xFF}}) {
      Frame frame;
      frame.fill(background);
      REQUIRE(encode(example.value, frame, example.signal));
      const auto written = std::bit_cast<std::uint64_t>(frame);
      const auto wanted = std::bit_cast<std::uint64_t>(example.frame);
      CHECK((written & own) == (wanted & own));
      CHECK((written & ~own) == ((background == 0 ? 0 : ~std::uint64_t{0}) & ~own));
    }
  }
}

TEST_CASE("signals anywhere in 8 and 64 bytes are written and read bit by bit", "[can][property]") {
  const int bytes = GENERATE(8, 64);
  const auto seed = GENERATE(range(0u, 300u));
  std::mt19937_64 random(seed);
  for (int round = 0; round < 20; ++round) {
    const CanSignal signal = random_signal(random, bytes);
    std::array<std::uint8_t, 64> before{};
    for (std::uint8_t& byte : before) byte = static_cast<std::uint8_t>(random());
    const std::uint64_t wanted = random() >> static_cast<unsigned>(64 - signal.length_bits);
    CAPTURE(bytes, seed, round, signal.start_bit, signal.length_bits,
            signal.byte_order == ByteOrder::big_endian);
    REQUIRE_NOTHROW(check(signal));
    REQUIRE(bits_of(signal).count() == static_cast<std::size_t>(signal.length_bits));
    auto after = before;
    // No byte after the signal is read: a frame that ends there is enough.
    const std::span<std::uint8_t> just_enough(after.data(), bytes_needed(signal));
    insert_raw(just_enough, signal, wanted);
    REQUIRE(extract_raw(just_enough, signal) == wanted);
    REQUIRE(read_bit_by_bit(just_enough, signal) == wanted);
    for (std::size_t bit = 0; bit < 512; ++bit) {
      const bool same = ((after[bit / 8] ^ before[bit / 8]) >> (bit % 8) & 1) == 0;
      if (!bits_of(signal)[bit] && !same) FAIL("bit " << bit << " has changed");
    }
  }
}

TEST_CASE("a multiplexed signal is in the frames with its page", "[can]") {
  CanSignal signal = intel(8, 16);
  signal.selectors = {{{0, 4, ByteOrder::little_endian}, {{2, 2}, {5, 7}}}};
  const auto carried = [&](std::uint8_t first) {
    const Frame frame{first, 0x34, 0x12};
    return carries(frame, signal);
  };
  CHECK(carried(0xF2));  // only the lowest four bits select
  CHECK(carried(5));
  CHECK(carried(7));
  CHECK_FALSE(carried(0));
  CHECK_FALSE(carried(3));
  CHECK_FALSE(carried(8));
  // The second multiplexor is itself on a page of the first: both must match.
  signal.selectors.push_back({{7, 1, ByteOrder::big_endian}, {{1, 1}}});
  CHECK(carried(0x82));
  CHECK_FALSE(carried(0x02));
  CHECK_FALSE(carried(0x83));
}

TEST_CASE("a frame too short for its multiplexor is bad, not of another page", "[can]") {
  CanSignal signal = intel(0, 8);
  signal.selectors = {{{16, 8, ByteOrder::little_endian}, {{1, 1}}}};
  const Frame frame{0x12, 0x34, 0x01};
  const std::span<const std::uint8_t> whole = frame;
  CHECK(bytes_needed(signal) == 3);
  CHECK(decode(whole.first(3), signal).value == 0x12);
  CHECK(carries(whole.first(2), signal));
  CHECK(decode(whole.first(2), signal).fault == Fault::bad_frame);
}

TEST_CASE("a random value is preserved within half a count", "[can][property]") {
  const auto seed = GENERATE(range(0u, 200u));
  std::mt19937_64 random(seed);
  CanSignal signal = random_signal(random);
  signal.length_bits = std::min(signal.length_bits, 40);  // a double holds every such count
  signal.scale = std::uniform_real_distribution<double>(0.001, 2.0)(random);
  signal.offset = std::uniform_real_distribution<double>(-50.0, 50.0)(random);
  const double counts = std::ldexp(1.0, signal.length_bits - (signal.is_signed ? 1 : 0)) - 1;
  const double lowest = signal.is_signed ? -counts - 1 : 0;
  const double value =
      std::uniform_real_distribution<double>(lowest, counts)(random) * signal.scale + signal.offset;
  Frame frame = random_frame(random);
  CAPTURE(seed, value, signal.length_bits, signal.is_signed);
  REQUIRE(encode(value, frame, signal));
  const double slack = 1e-9 * std::abs(value) + 1e-12;
  CHECK(std::abs(decode(frame, signal).value - value) <= 0.5 * signal.scale + slack);
}

TEST_CASE("a value beyond a CAN signal is saturated and reported", "[can]") {
  const double big = 1e300;
  const double infinite = std::numeric_limits<double>::infinity();
  for (const CanSignal& signal :
       {intel(3, 12, true), motorola(3, 12, true), intel(0, 64, true), motorola(7, 64, true)}) {
    const double above = std::ldexp(1.0, signal.length_bits - 1);
    for (const double value : {big, infinite, above}) {
      Frame frame{};
      CHECK_FALSE(encode(value, frame, signal));
      CHECK(extract_raw(frame, signal) == static_cast<std::uint64_t>(above) - 1);
      CHECK_FALSE(encode(-2 * value, frame, signal));
      CHECK(decode(frame, signal).value == -above);
    }
    Frame frame{};
    CHECK(encode(-above, frame, signal));
    CHECK(decode(frame, signal).value == -above);
  }
  Frame frame{};
  CHECK_FALSE(encode(-1.0, frame, intel(0, 16)));
  CHECK(decode(frame, intel(0, 16)).value == 0.0);
  CHECK_FALSE(encode(65536.0, frame, intel(0, 16)));
  CHECK(decode(frame, intel(0, 16)).value == 65535.0);
  CHECK_FALSE(encode(std::ldexp(1.0, 64), frame, intel(0, 64)));
  CHECK(extract_raw(frame, intel(0, 64)) == ~std::uint64_t{0});
  CHECK_FALSE(encode(1e39, frame, floating(intel(0, 32))));
  CHECK(decode(frame, floating(intel(0, 32))).value == std::numeric_limits<float>::max());
}

TEST_CASE("NaN is never written to a frame", "[can]") {
  Frame frame;
  frame.fill(0x5A);
  const Frame before = frame;
  CHECK_FALSE(encode(not_a_number, frame, intel(0, 16)));
  CHECK_FALSE(encode(not_a_number, frame, floating(intel(0, 32))));
  CHECK(frame == before);
}

TEST_CASE("a sentinel code in a CAN frame is a fault, not a temperature", "[can]") {
  CanSignal signal = scaled(intel(0, 16, true), 0.1, 0.0);
  signal.sentinels = {{32767, Fault::open_circuit}, {-32768, Fault::short_circuit}};
  const Frame open{0xFF, 0x7F};
  CHECK(decode(open, signal).fault == Fault::open_circuit);
  CHECK(std::isnan(decode(open, signal).value));
  const Frame shorted{0x00, 0x80};
  CHECK(decode(shorted, signal).fault == Fault::short_circuit);
  const Frame beside{0xFE, 0x7F};
  CHECK(decode(beside, signal).fault == Fault::none);
  // The same bits of an unsigned signal are the code 65535, not -1.
  CanSignal unsigned_signal = intel(0, 16);
  unsigned_signal.sentinels = {{65535, Fault::open_circuit}};
  const Frame all_ones{0xFF, 0xFF};
  CHECK(decode(all_ones, unsigned_signal).fault == Fault::open_circuit);
  signal.sentinels = {{65535, Fault::open_circuit}};
  CHECK(decode(all_ones, signal).fault == Fault::none);
}

TEST_CASE("a CAN frame too short for the signal is a bad frame", "[can]") {
  const Frame frame{0x12, 0x34, 0x56};
  const std::span<const std::uint8_t> whole = frame;
  CHECK(decode(whole.first(1), intel(4, 12)).fault == Fault::bad_frame);
  CHECK(decode(whole.first(2), intel(4, 12)).fault == Fault::none);
  CHECK(decode(whole.first(1), motorola(3, 12)).fault == Fault::bad_frame);
  CHECK(decode(whole.first(2), motorola(3, 12)).fault == Fault::none);
  CHECK(decode(whole.first(0), intel(0, 1)).fault == Fault::bad_frame);
}

TEST_CASE("a non-finite float is out of range", "[can]") {
  const CanSignal signal = floating(intel(0, 32));
  const Frame quiet_nan{0x00, 0x00, 0xC0, 0x7F};
  const Frame infinite{0x00, 0x00, 0x80, 0xFF};
  CHECK(decode(quiet_nan, signal).fault == Fault::out_of_range);
  CHECK(decode(infinite, signal).fault == Fault::out_of_range);
}

TEST_CASE("an invalid CAN signal is refused with its key", "[can]") {
  const auto refused_key = [](const CanSignal& signal) -> std::string {
    try {
      check(signal);
    } catch (const InvalidValue& error) {
      return error.key();
    }
    return "accepted";
  };
  CHECK(refused_key(intel(0, 64)) == "accepted");
  CHECK(refused_key(motorola(7, 64)) == "accepted");
  CHECK(refused_key(motorola(56, 1)) == "accepted");
  CHECK(refused_key(intel(1, 64)) == "start_bit");
  CHECK(refused_key(intel(56, 9)) == "start_bit");
  CHECK(refused_key(motorola(0, 64)) == "start_bit");
  CHECK(refused_key(motorola(56, 2)) == "start_bit");
  CHECK(refused_key(intel(64, 1)) == "start_bit");
  CHECK(refused_key(intel(-1, 8)) == "start_bit");
  CHECK(refused_key(intel(0, 0)) == "length_bits");
  CHECK(refused_key(intel(0, 65)) == "length_bits");
  CHECK(refused_key(floating(intel(0, 16))) == "length_bits");
  CanSignal wide = intel(64, 8);
  wide.fd = true;
  CHECK(refused_key(wide) == "accepted");
  wide.start_bit = 505;
  CHECK(refused_key(wide) == "start_bit");
  CanSignal multiplexed = intel(0, 8);
  multiplexed.selectors = {{{60, 8, ByteOrder::little_endian}, {{0, 0}}}};
  CHECK(refused_key(multiplexed) == "start_bit");
  multiplexed.selectors = {{{0, 8, ByteOrder::little_endian}, {}}};
  CHECK(refused_key(multiplexed) == "multiplexor");
  CHECK(refused_key(scaled(intel(0, 16), 0.0, 0.0)) == "scale");
  CHECK(refused_key(scaled(intel(0, 16), not_a_number, 0.0)) == "scale");
  CHECK(refused_key(scaled(intel(0, 16), 1.0, not_a_number)) == "offset");
  CanSignal wide_id = intel(0, 8);
  wide_id.id = 0x800;
  CHECK(refused_key(wide_id) == "id");
  wide_id.extended_id = true;
  CHECK(refused_key(wide_id) == "accepted");
  wide_id.id = 0x20000000;
  CHECK(refused_key(wide_id) == "id");
}

TEST_CASE("a status in the frame decides whether the value is good", "[can]") {
  CanSignal signal = intel(0, 16);
  signal.sentinels = {{0x7FFF, Fault::open_circuit}};
  signal.status = CanStatus{{16, 8, ByteOrder::little_endian}, 0x07, {}};
  signal.status->codes = {{2, Fault::out_of_range}, {6, Fault::none}};
  const auto seen = [&](std::vector<std::uint8_t> bytes) { return decode(bytes, signal); };
  CHECK(seen({0xFA, 0x00, 0x00}).fault == Fault::device_error);  // 0 is not listed, another is
  CHECK(seen({0xFA, 0x00, 0xFE}).value == 250.0);                // bits outside the mask
  CHECK(seen({0xFA, 0x00, 0x06}).value == 250.0);                // listed as good
  CHECK(seen({0xFA, 0x00, 0x02}).fault == Fault::out_of_range);
  CHECK(seen({0xFA, 0x00, 0x01}).fault == Fault::device_error);  // listed nowhere
  CHECK(seen({0xFF, 0x7F, 0x02}).fault ==
        Fault::open_circuit);  // the value's own code takes precedence
  CHECK(seen({0xFA, 0x00}).fault == Fault::bad_frame);
  CHECK(bytes_needed(signal) == 3);
  signal.status->codes = {{2, Fault::out_of_range}};
  CHECK(seen({0xFA, 0x00, 0x00}).value == 250.0);
  signal.status->field.start_bit = 60;
  CHECK_THROWS_AS(check(signal), InvalidValue);
}
