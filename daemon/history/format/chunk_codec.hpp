/// Records <-> the bytes of one chunk: small changes take few bytes, and every bit is kept.
///
/// A record is: kind, detail, cycle (difference to the record before), index, time (difference to
/// the last one of its kind), value (XOR with the last one of its kind and index; a byte that says
/// how many bytes are zero at either end, then the bytes between). A typical reading takes 15 bytes
/// instead of 32. Each chunk starts afresh, so that one can be read without the others.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/history/format/byte_codec.hpp"
#include "daemon/recording/record.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What both sides predict the next record from.
class RecordPrediction {
 public:
  static constexpr std::size_t indices_max = 4096;  ///< beyond this, values are stored in full
  std::uint64_t cycle{0};
  std::array<std::int64_t, record_kinds_count> time_ns{};
  /// Bits of the last value of this kind and index, or nullptr where none are kept.
  [[nodiscard]] std::uint64_t* value_bits(RecordKind kind, std::uint32_t index);

 private:
  std::array<std::vector<std::uint64_t>, record_kinds_count> values_;
};

class ChunkEncoder {
 public:
  void add(const Record& record);
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::size_t size_bytes() const noexcept { return writer_.bytes().size(); }
  /// The chunk so far; the encoder is then empty.
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
  /// @return false when all `count` records were read
  /// @throws HistoryError when the bytes cannot be what an encoder wrote
  bool next(Record& out);

 private:
  std::vector<std::byte> bytes_;
  ByteReader reader_;
  RecordPrediction last_;
  std::uint64_t left_;
};

/// Whether a time on the daemon's grid is possible: not before the start of the system, nor
/// centuries later.
[[nodiscard]] constexpr bool is_grid_time(std::int64_t time_ns) noexcept {
  return time_ns >= 0 && time_ns <= (std::int64_t{1} << 61);
}

/// Adds a checksum: the estimator's state has inner counts and places that are believed when it is
/// loaded, so bytes that changed on the disk must be refused.
void add_seal(std::vector<std::byte>& bytes);
/// Takes the checksum off. @throws HistoryError when it does not fit
void take_seal(std::vector<std::byte>& bytes);

/// The inputs in force at the start of a segment.
[[nodiscard]] std::vector<std::byte> encode_inputs(std::span<const Reading> readings,
                                                   const ControllerState& controller);
/// @throws HistoryError
void decode_inputs(std::span<const std::byte> bytes, std::vector<Reading>& readings,
                   ControllerState& controller);

}  // namespace thermocomp
