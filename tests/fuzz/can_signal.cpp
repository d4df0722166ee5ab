/// CAN signals: encoding and decoding of any signal accepted by check(), with any payload.
#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "common/fuzz.hpp"
#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;

namespace {

CanSignal signal_from(fuzz::ByteFeed& feed) {
  CanSignal signal;
  const std::uint8_t kind = feed.u8();
  signal.byte_order = (kind & 1) != 0 ? ByteOrder::big_endian : ByteOrder::little_endian;
  signal.is_signed = (kind & 2) != 0;
  signal.is_float = (kind & 4) != 0;
  signal.extended_id = (kind & 8) != 0;
  signal.fd = (kind & 32) != 0;
  signal.start_bit = static_cast<std::int8_t>(feed.u8()) * (signal.fd ? 4 : 1);
  signal.length_bits = static_cast<std::int8_t>(feed.u8());
  signal.id = static_cast<std::uint32_t>(feed.u16()) << ((kind & 16) != 0 ? 16 : 0);
  signal.scale = (kind & 0x80) != 0 ? feed.f64() : (feed.u8() + 1) * 0.25;
  signal.offset = (kind & 0x80) != 0 ? feed.f64() : feed.u8() - 100.0;
  signal.sentinels.resize(feed.u8() % 4);
  for (Sentinel& sentinel : signal.sentinels) {
    sentinel.code = std::bit_cast<std::int64_t>(feed.u64());
    sentinel.fault = static_cast<Fault>(1 + feed.u8() % (faults_count - 1));
  }
  signal.selectors.resize(feed.u8() % 3);
  for (CanSelector& selector : signal.selectors) {
    selector.field = {static_cast<std::int8_t>(feed.u8()), static_cast<std::int8_t>(feed.u8()),
                      feed.u8() % 2 == 0 ? ByteOrder::little_endian : ByteOrder::big_endian};
    selector.pages.resize(feed.u8() % 3);
    for (CanSelector::Pages& pages : selector.pages) pages = {feed.u8(), feed.u8()};
  }
  if ((kind & 64) != 0) {
    CanStatus& status = signal.status.emplace();
    status.field = {static_cast<std::int8_t>(feed.u8()), static_cast<std::int8_t>(feed.u8()),
                    feed.u8() % 2 == 0 ? ByteOrder::little_endian : ByteOrder::big_endian};
    status.mask = feed.u64();
    status.codes = {{feed.u8(), Fault::none}, {feed.u8(), Fault::open_circuit}};
  }
  return signal;
}

/// The signal's bits are restored; all other bits of the frame are unchanged.
void check_insertion(const CanSignal& signal, std::vector<std::uint8_t> payload,
                     std::uint64_t raw) {
  const std::vector<std::uint8_t> before = payload;
  insert_raw(payload, signal, raw);
  const CanBits mask = bits_of(signal);
  for (std::size_t i = 0; i < payload.size(); ++i) {
    const auto own = static_cast<std::uint8_t>(((mask >> (8 * i)) & CanBits(0xFF)).to_ulong());
    FUZZ_REQUIRE(((payload[i] ^ before[i]) & static_cast<std::uint8_t>(~own)) == 0);
  }
  const std::uint64_t low =
      signal.length_bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << signal.length_bits) - 1;
  FUZZ_REQUIRE(extract_raw(payload, signal) == (raw & low));
  FUZZ_REQUIRE(mask.count() == static_cast<std::size_t>(signal.length_bits));
}

/// Only a multiplexor within the payload can exclude the signal.
void check_pages(const CanSignal& signal, const std::vector<std::uint8_t>& payload) {
  const auto readable = [&](const CanSelector& selector) {
    return payload.size() >= bytes_needed(selector.field);
  };
  const bool any = std::any_of(signal.selectors.begin(), signal.selectors.end(), readable);
  FUZZ_REQUIRE(any || carries(payload, signal));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  CanSignal signal = signal_from(feed);
  try {
    check(signal);
  } catch (const InvalidValue& error) {
    FUZZ_REQUIRE(!error.key().empty() && !error.rule().empty());
    return 0;
  }
  std::vector<std::uint8_t> payload = feed.take(feed.u8() % (signal.fd ? 65U : 9U));
  check_pages(signal, payload);
  const CanValue decoded = decode(payload, signal);
  FUZZ_REQUIRE(std::isfinite(decoded.value) == (decoded.fault == Fault::none));
  const bool too_short = payload.size() < bytes_needed(signal);
  FUZZ_REQUIRE(!too_short || decoded.fault == Fault::bad_frame);
  // The status signal gives the fault of values that have no fault of their own.
  if (signal.status && !too_short) {
    CanSignal alone = signal;
    alone.status.reset();
    const Fault reported = fault_of(*signal.status, extract_raw(payload, signal.status->field));
    const Fault own = decode(payload, alone).fault;
    FUZZ_REQUIRE(decoded.fault == (own == Fault::none ? reported : own));
  }
  FUZZ_REQUIRE(bytes_needed(signal) >= 1 &&
               bytes_needed(signal) <= (signal.fd ? can_bytes_max : can_classic_bytes_max));
  if (too_short) return 0;

  check_insertion(signal, payload, feed.u64());
  const double any = feed.f64();
  const std::vector<std::uint8_t> before = payload;
  const bool fitted = encode(any, payload, signal);
  if (std::isnan(any)) FUZZ_REQUIRE(!fitted && payload == before);
  const bool ordinary = std::abs(signal.scale) >= 1e-3 && std::abs(signal.scale) <= 1e3 &&
                        std::abs(signal.offset) <= 1e3 && !signal.is_float;
  if (fitted && ordinary && std::abs(any) < 1e9) {
    signal.sentinels.clear();
    signal.status.reset();
    const CanValue again = decode(payload, signal);
    FUZZ_REQUIRE(again.fault == Fault::none);
    FUZZ_REQUIRE(std::abs(again.value - any) <= 0.5 * resolution(signal) + 1e-6);
  }
  return 0;
}
