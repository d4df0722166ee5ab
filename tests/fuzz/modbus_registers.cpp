/// Conversion between registers and numbers, all encodings, orders, sentinels and status words.
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "common/fuzz.hpp"
#include "drivers/modbus/modbus_codec.hpp"

using namespace thermocomp;

namespace {

NumberFormat format_from(fuzz::ByteFeed& feed) {
  NumberFormat format;
  const std::uint8_t kind = feed.u8();
  format.encoding = static_cast<Encoding>(kind % 6);
  format.word_order = static_cast<WordOrder>(kind / 6 % 4);
  // The scale of a file is finite and not 0; mostly an ordinary one, else any bits.
  format.scale = (kind & 0x80) != 0 ? feed.f64() : (feed.u8() + 1) * 0.1;
  format.offset = (kind & 0x80) != 0 ? feed.f64() : feed.u8() - 100.0;
  if (!std::isfinite(format.scale) || format.scale == 0.0) format.scale = 0.1;
  if (!std::isfinite(format.offset)) format.offset = 0.0;
  return format;
}

std::vector<Sentinel> sentinels_from(fuzz::ByteFeed& feed) {
  std::vector<Sentinel> sentinels(feed.u8() % 4);
  for (Sentinel& sentinel : sentinels) {
    sentinel.code = std::bit_cast<std::int64_t>(feed.u64());
    sentinel.fault = static_cast<Fault>(1 + feed.u8() % (faults_count - 1));
  }
  return sentinels;
}

/// A decoded number, written and read again, is unchanged.
void check_round_trip(const Decoded& decoded, const NumberFormat& format) {
  const Encoded encoded = encode(decoded.value, format);
  if (encoded.result == EncodeResult::refused) {
    // Fails only if the conversion to a raw value overflows.
    FUZZ_REQUIRE(!std::isfinite((decoded.value - format.offset) / format.scale));
    return;
  }
  FUZZ_REQUIRE(encoded.count == registers_of(format.encoding));
  const Decoded again = decode(encoded.words(), format, {});
  if (again.fault == Fault::none) {
    FUZZ_REQUIRE(std::bit_cast<std::uint64_t>(again.value) ==
                 std::bit_cast<std::uint64_t>(encoded.value));
  }
  const bool ordinary = std::abs(format.scale) >= 1e-3 && std::abs(format.scale) <= 1e3 &&
                        std::abs(format.offset) <= 1e3;
  const bool whole = format.encoding != Encoding::float32 && format.encoding != Encoding::float64;
  if (ordinary && whole) {
    FUZZ_REQUIRE(encoded.result == EncodeResult::exact);
    FUZZ_REQUIRE(std::abs(again.value - decoded.value) <= 0.5 * std::abs(format.scale) + 1e-6);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  const auto table = static_cast<ModbusTable>(feed.u8() % 4);
  const NumberFormat format = format_in(table, format_from(feed));
  const std::vector<Sentinel> sentinels = sentinels_from(feed);
  // Exactly the required number, on the heap, to detect reads beyond the end.
  std::vector<std::uint16_t> registers(words_of(table, format.encoding));
  for (std::uint16_t& word : registers) word = is_bit_table(table) ? feed.u8() & 1 : feed.u16();

  const Decoded decoded = decode(registers, format, sentinels);
  FUZZ_REQUIRE(std::isfinite(decoded.value) == (decoded.fault == Fault::none));
  FUZZ_REQUIRE(static_cast<std::size_t>(decoded.fault) < faults_count);
  if (decoded.fault == Fault::none) check_round_trip(decoded, format);

  const double any = feed.f64();
  const Encoded encoded = encode(any, format);
  FUZZ_REQUIRE(std::isfinite(any) || encoded.result == EncodeResult::refused);
  FUZZ_REQUIRE((encoded.count == 0) == (encoded.result == EncodeResult::refused));

  ModbusStatus status;
  status.table = table;
  status.mask = feed.u16();
  status.codes = sentinels;
  const Fault fault = decode_status(status, registers[0]);
  FUZZ_REQUIRE(static_cast<std::size_t>(fault) < faults_count);
  for (const Sentinel& sentinel : sentinels) {
    static_cast<void>(is_representable(sentinel.code, format.encoding));
  }
  return 0;
}
