#include "daemon/history/format/row_checksum.hpp"

#include <bit>
#include <string>

#include "daemon/history/format/byte_codec.hpp"

namespace thermocomp {

RowChecksum& RowChecksum::add(std::int64_t value) noexcept {
  auto bits = static_cast<std::uint64_t>(value);
  for (int i = 0; i < 8; ++i, bits >>= 8) hash_ = (hash_ ^ (bits & 0xFFu)) * 0x100000001b3u;
  return *this;
}

RowChecksum& RowChecksum::add(std::span<const std::byte> bytes) noexcept {
  add(static_cast<std::int64_t>(bytes.size()));
  hash_ = fnv_1a(bytes, hash_);
  return *this;
}

RowChecksum& RowChecksum::add(std::string_view text) noexcept {
  return add(std::as_bytes(std::span(text)));
}

std::int64_t RowChecksum::value() const noexcept {
  return std::bit_cast<std::int64_t>(hash_);
}

std::int64_t checksum_of(const ChunkNumbers& numbers, std::span<const std::byte> records) noexcept {
  RowChecksum checksum;
  checksum.add(numbers.number).add(numbers.count).add(numbers.through_cycle);
  return checksum.add(numbers.wall_minus_grid_ns).add(records).value();
}

std::optional<ChunkContent> read_chunk(Database& database, std::int64_t segment,
                                       std::int64_t number) {
  Statement row(database,
                "SELECT records, count, through_cycle, wall_minus_grid_ns, checksum IS NULL,"
                " checksum FROM chunk WHERE segment = ? AND number = ?");
  row.bind(segment).bind(number);
  if (!row.step()) return std::nullopt;
  ChunkContent chunk{{number, row.number(1), row.number(2), row.number(3)}, row.blob(0)};
  if (row.number(4) == 0 && row.number(5) != checksum_of(chunk.numbers, chunk.records))
    throw HistoryError("chunk " + std::to_string(number) + " does not fit its checksum");
  return chunk;
}

std::int64_t segment_checksum(Database& database, std::int64_t segment) {
  Statement row(database,
                "SELECT run, reason, grid_start_ns, period_ns, first_cycle, wall_ns,"
                " program_version, inputs, estimator_state, config_text, model_text,"
                " model_checksum FROM segment JOIN setup ON setup.id = segment.setup"
                " WHERE segment.id = ?");
  row.bind(segment);
  if (!row.step()) throw HistoryError("the row of the segment or of its configuration is missing");
  RowChecksum checksum;
  for (int column = 0; column < 6; ++column) checksum.add(row.number(column));
  checksum.add(std::string_view(row.text(6)));
  for (int column = 7; column < 9; ++column) {
    checksum.add(std::span<const std::byte>(row.blob(column)));
  }
  for (int column = 9; column < 12; ++column) checksum.add(std::string_view(row.text(column)));
  return checksum.value();
}

void check_segment_row(Database& database, std::int64_t segment) {
  Statement row(database, "SELECT checksum FROM segment WHERE id = ? AND checksum IS NOT NULL");
  row.bind(segment);
  if (row.step() && row.number(0) != segment_checksum(database, segment)) {
    throw HistoryError("the row of the segment, or its configuration, does not fit its checksum");
  }
}

}  // namespace thermocomp
