/// Checksums of the history's rows: SQLite has none of its own, and a packed value with a flipped
/// bit is still a value. Only for the .cpp files of this folder.
///
/// `chunk.checksum` covers the chunk's numbers and records, `segment.checksum` what is written once
/// for a segment and the texts of its setup. A row with NULL is judged by what else it says.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "daemon/history/format/database.hpp"

namespace thermocomp {

/// FNV-1a, 64 bits, as the signed number that SQLite keeps. Source: draft-eastlake-fnv, section 2.
class RowChecksum {
 public:
  RowChecksum& add(std::int64_t value) noexcept;
  RowChecksum& add(std::span<const std::byte> bytes) noexcept;  ///< with its length
  RowChecksum& add(std::string_view text) noexcept;
  [[nodiscard]] std::int64_t value() const noexcept;

 private:
  std::uint64_t hash_{0xcbf29ce484222325u};
};

struct ChunkNumbers {
  std::int64_t number{0};
  std::int64_t count{0};
  std::int64_t through_cycle{0};
  std::int64_t wall_minus_grid_ns{0};
};
[[nodiscard]] std::int64_t checksum_of(const ChunkNumbers& numbers,
                                       std::span<const std::byte> records) noexcept;

struct ChunkContent {
  ChunkNumbers numbers;
  std::vector<std::byte> records;
};
/// Empty: there is no such row. @throws HistoryError when it does not fit its checksum
[[nodiscard]] std::optional<ChunkContent> read_chunk(Database& database, std::int64_t segment,
                                                     std::int64_t number);

/// The checksum that the row of this segment should have. @throws HistoryError: no such row
[[nodiscard]] std::int64_t segment_checksum(Database& database, std::int64_t segment);
/// @throws HistoryError when the row does not fit its checksum
void check_segment_row(Database& database, std::int64_t segment);

}  // namespace thermocomp
