#include <random>
#include <thread>

#include <catch2/catch.hpp>

#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/recording/record.hpp"

using namespace thermocomp;

namespace {

Record numbered(std::uint64_t n) {
  Record record;
  record.cycle = n;
  record.value = static_cast<double>(n) * 0.5;
  record.index = static_cast<std::uint32_t>(n % 7);
  return record;
}

bool same_record(const Record& a, const Record& b) {
  return a.cycle == b.cycle && a.time_ns == b.time_ns && same_bits(a.value, b.value) &&
         a.index == b.index && a.kind == b.kind && a.detail == b.detail;
}

}  // namespace

TEST_CASE("every record comes out of the ring once and in order", "[history][ring]") {
  RecordRing ring(256);
  constexpr std::uint64_t count = 300000;
  std::thread producer([&] {
    for (std::uint64_t n = 0; n < count;) {
      if (ring.try_push(numbered(n))) {
        ++n;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t expected = 0;
  bool in_order = true;
  std::array<Record, 100> batch;
  while (expected < count) {
    const std::size_t got = ring.pop(batch);
    for (std::size_t i = 0; i < got; ++i) {
      in_order = in_order && same_record(batch[i], numbered(expected++));
    }
    if (got == 0) std::this_thread::yield();
  }
  producer.join();
  CHECK(in_order);
  CHECK(ring.pop(batch) == 0);
}

TEST_CASE("a full ring refuses and keeps its records", "[history][ring]") {
  RecordRing ring(5);
  REQUIRE(ring.capacity() == 8);
  for (std::uint64_t n = 0; n < 8; ++n) REQUIRE(ring.try_push(numbered(n)));
  CHECK_FALSE(ring.try_push(numbered(8)));
  CHECK(ring.free_places() == 0);
  std::array<Record, 3> batch;
  REQUIRE(ring.pop(batch) == 3);
  CHECK(batch[2].cycle == 2);
  CHECK(ring.free_places() == 3);
  CHECK(ring.try_push(numbered(8)));
}

TEST_CASE("a chunk reproduces every bit of every record", "[history][codec]") {
  const unsigned seed = GENERATE(range(0u, 50u));
  std::mt19937_64 random(seed);
  std::vector<Record> records;
  ChunkEncoder encoder;
  for (int i = 0; i < 500; ++i) {
    Record record;
    record.cycle = random() % 3 == 0 ? random() : 1000 + static_cast<std::uint64_t>(i);
    record.time_ns = static_cast<std::int64_t>(random() % 2 == 0 ? random() : random() % 1000);
    const std::uint64_t bits = random() % 4 == 0 ? random() : std::bit_cast<std::uint64_t>(21.5);
    record.value = std::bit_cast<double>(bits);  // includes NaN with payload and -0
    record.index = static_cast<std::uint32_t>(random() % 3 == 0 ? random() : random() % 20);
    record.kind = static_cast<RecordKind>(random() % record_kinds_count);
    record.detail = static_cast<std::uint8_t>(random());
    records.push_back(record);
    encoder.add(record);
  }
  ChunkDecoder decoder(encoder.take(), records.size());
  Record out;
  for (const Record& record : records) {
    REQUIRE(decoder.next(out));
    REQUIRE(same_record(out, record));
  }
  CHECK_FALSE(decoder.next(out));
  CHECK(encoder.count() == 0);
}

TEST_CASE("a damaged chunk is an error and never a crash", "[history][codec]") {
  const unsigned seed = GENERATE(range(0u, 200u));
  std::mt19937_64 random(seed);
  ChunkEncoder encoder;
  for (std::uint64_t n = 0; n < 50; ++n) encoder.add(numbered(random()));
  std::vector<std::byte> bytes = encoder.take();
  for (int i = 0; i < 5; ++i) bytes[random() % bytes.size()] = static_cast<std::byte>(random());
  bytes.resize(random() % (bytes.size() + 1));
  try {
    ChunkDecoder decoder(bytes, 50);
    Record out;
    int count = 0;
    while (decoder.next(out)) ++count;
    CHECK(count == 50);
  } catch (const HistoryError& error) {
    CHECK(std::string(error.what()).find("damaged") != std::string::npos);
  }
}
