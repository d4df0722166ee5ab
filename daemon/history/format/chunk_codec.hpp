/// Lossless compression of records into the bytes of one chunk.
///
/// A record is: kind, detail, cycle (difference from the previous record), index, time (difference
/// from the last one of its kind), value (XOR with the last one of its kind and index: a byte with
/// the numbers of zero bytes at either end, then the bytes between). A typical reading takes 15
/// bytes instead of 32. Each chunk can be read alone.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/history/format/segments.hpp"
#include "daemon/recording/record.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Maps small signed numbers to small unsigned ones: 0, -1, 1, -2 -> 0, 1, 2, 3.
[[nodiscard]] constexpr std::uint64_t zigzag(std::int64_t value) noexcept {
  return (static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63);
}
[[nodiscard]] constexpr std::int64_t unzigzag(std::uint64_t value) noexcept {
  return static_cast<std::int64_t>((value >> 1) ^ (~(value & 1) + 1));
}

/// FNV-1a, 64 bits, continuing from `hash`. Source: draft-eastlake-fnv, section 2.
[[nodiscard]] constexpr std::uint64_t fnv_1a(std::span<const std::byte> bytes,
                                             std::uint64_t hash = 0xcbf29ce484222325u) noexcept {
  for (const std::byte byte : bytes)
    hash = (hash ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3u;
  return hash;
}

/// Little-endian encoder of records and snapshots.
class ByteWriter {
 public:
  void u8(std::uint8_t value) { bytes_.push_back(static_cast<std::byte>(value)); }
  /// Seven bits per byte, lowest first.
  void varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) u8(static_cast<std::uint8_t>(value | 0x80));
    u8(static_cast<std::uint8_t>(value));
  }
  void f64(double value) {
    auto bits = std::bit_cast<std::uint64_t>(value);
    for (int i = 0; i < 8; ++i, bits >>= 8) u8(static_cast<std::uint8_t>(bits));
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::vector<std::byte>& bytes() noexcept { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// @throws HistoryError when the bytes end early
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  std::uint8_t u8() {
    if (at_ >= bytes_.size()) throw HistoryError("damaged: a record ends early");
    return static_cast<std::uint8_t>(bytes_[at_++]);
  }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const std::uint8_t byte = u8();
      value |= static_cast<std::uint64_t>(byte & 0x7F) << shift;
      if (byte < 0x80) return value;
    }
    throw HistoryError("damaged: a number does not end");
  }
  double f64() {
    std::uint64_t bits = 0;
    for (unsigned i = 0; i < 8; ++i) bits |= static_cast<std::uint64_t>(u8()) << (8 * i);
    return std::bit_cast<double>(bits);
  }
  [[nodiscard]] bool at_end() const noexcept { return at_ == bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_{0};
};

/// State from which encoder and decoder predict the next record.
class RecordPrediction {
 public:
  static constexpr std::size_t indices_max = 4096;  ///< beyond this, values are stored in full
  std::uint64_t cycle{0};
  std::array<std::int64_t, record_kinds_count> time_ns{};
  /// Bits of the last value of this kind and index; nullptr if not kept.
  [[nodiscard]] std::uint64_t* value_bits(RecordKind kind, std::uint32_t index);

 private:
  std::array<std::vector<std::uint64_t>, record_kinds_count> values_;
};

class ChunkEncoder {
 public:
  void add(const Record& record);
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::size_t size_bytes() const noexcept { return writer_.bytes().size(); }
  /// The chunk so far; empties the encoder.
  [[nodiscard]] std::vector<std::byte> take();

 private:
  ByteWriter writer_;
  RecordPrediction last_;
  std::uint64_t count_{0};
};

class ChunkDecoder {
 public:
  ChunkDecoder(std::vector<std::byte> bytes, std::uint64_t count);
  ChunkDecoder(const ChunkDecoder&) = delete;
  ChunkDecoder& operator=(const ChunkDecoder&) = delete;
  /// @return false after all `count` records
  /// @throws HistoryError when the bytes are not an encoder's output
  bool next(Record& out);

 private:
  std::vector<std::byte> bytes_;
  ByteReader reader_;
  RecordPrediction last_;
  std::uint64_t left_;
};

/// A time on the daemon's grid.
/// @throws HistoryError when it is before system start, or centuries later
[[nodiscard]] nanoseconds grid_time_from(std::int64_t time_ns);
/// @throws HistoryError
[[nodiscard]] Fault fault_from(std::uint8_t code);

/// Appends a checksum: loading the estimator's state relies on its counts and indices, so bytes
/// changed on disk must be refused.
void add_seal(std::vector<std::byte>& bytes);
/// Removes the checksum. @throws HistoryError when it does not match
void take_seal(std::vector<std::byte>& bytes);

/// The inputs at the start of a segment.
[[nodiscard]] std::vector<std::byte> encode_inputs(std::span<const Reading> readings,
                                                   const ControllerState& controller);
/// @throws HistoryError
void decode_inputs(std::span<const std::byte> bytes, std::vector<Reading>& readings,
                   ControllerState& controller);

}  // namespace thermocomp
