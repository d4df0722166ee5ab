/// The history's packed records, the inputs and the estimator's state at a segment's start.
#include <bit>
#include <span>
#include <vector>

#include "common/fuzz.hpp"
#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/segments.hpp"

using namespace thermocomp;

namespace {

bool same(const Record& a, const Record& b) {
  return a.cycle == b.cycle && a.time_ns == b.time_ns && same_bits(a.value, b.value) &&
         a.index == b.index && a.kind == b.kind && a.detail == b.detail;
}

/// @return the records before the damage, or all of them
std::vector<Record> decoded(std::vector<std::byte> bytes, std::uint64_t count) {
  std::vector<Record> records;
  try {
    ChunkDecoder decoder(std::move(bytes), count);
    Record record;
    while (decoder.next(record)) records.push_back(record);
    FUZZ_REQUIRE(records.size() == count);
  } catch (const HistoryError&) {
    FUZZ_REQUIRE(records.size() <= count);
  }
  return records;
}

void check_chunk(std::span<const std::byte> bytes, std::uint64_t count) {
  const std::vector<Record> records = decoded({bytes.begin(), bytes.end()}, count);
  ChunkEncoder encoder;
  for (const Record& record : records) encoder.add(record);
  const std::vector<Record> again = decoded(encoder.take(), records.size());
  FUZZ_REQUIRE(again.size() == records.size());
  for (std::size_t i = 0; i < records.size(); ++i) FUZZ_REQUIRE(same(records[i], again[i]));
}

void check_inputs(std::span<const std::byte> bytes) {
  std::vector<Reading> readings;
  ControllerState controller;
  try {
    decode_inputs(bytes, readings, controller);
  } catch (const HistoryError&) {
    return;
  }
  std::vector<Reading> readings_again;
  ControllerState controller_again;
  const auto written = encode_inputs(readings, controller);
  decode_inputs(written, readings_again, controller_again);
  FUZZ_REQUIRE(encode_inputs(readings_again, controller_again) == written);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  const bool is_chunk = (feed.u8() & 1) == 0;
  const std::uint64_t count = is_chunk ? feed.u16() : 0;
  const auto bytes = std::as_bytes(feed.rest());
  if (is_chunk) {
    check_chunk(bytes, count);
  } else {
    check_inputs(bytes);
  }
  return 0;
}
