/// The records from the cycle to the history: fixed size, stamped with the grid cycle, passed
/// through a wait-free ring.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "estimator/types.hpp"

namespace thermocomp {

/// The daemon's time: cycle k is stepped with exactly this time, however late it ran, so that a
/// replay needs no clock readings.
struct Grid {
  nanoseconds start{};  ///< CLOCK_MONOTONIC of cycle 0
  nanoseconds period{std::chrono::milliseconds(10)};
  [[nodiscard]] nanoseconds time_of(std::uint64_t cycle) const noexcept {
    return start + period * static_cast<std::int64_t>(cycle);
  }
};

enum class RecordKind : std::uint8_t {
  reading,     ///< index: sensor; value: temp [degC]; time: taken_at; detail: Fault
  link,        ///< index: link epoch; time: taken_at; detail: link_bits()
  applied,     ///< index: axis; value: applied offset [um]
  signal,      ///< index: signal; value: in its unit
  command,     ///< index: axis; value [um]; detail: CommandKind; time_ns: measured_bits(). Applied
               ///< before that cycle's step
  skipped,     ///< cycle: first cycle that was not stepped; time_ns: the last such cycle
  offset,      ///< proof, after the step. index: axis; value [um]; time_ns: epoch; detail: valid
  cycle_done,  ///< everything up to and with this cycle is in the ring
  segment_begin  ///< cycle: first cycle to step from the snapshot; time_ns: the last cycle that was
                 ///< recorded whole before it, or -1; value: unused; index: snapshot;
                 ///< detail: SegmentReason; session: whose snapshot
};
inline constexpr std::size_t record_kinds_count = 9;

/// Why a segment of the history begins.
enum class SegmentReason : std::uint8_t {
  start,
  reload,    ///< another configuration or model
  periodic,  ///< `segment_h` is over, or the segment has become large
  gap        ///< earlier records were lost
};
[[nodiscard]] std::string_view to_string(SegmentReason reason) noexcept;

struct Record {
  std::uint64_t cycle{0};
  std::int64_t time_ns{0};
  double value{0.0};
  std::uint32_t index{0};
  RecordKind kind{RecordKind::cycle_done};
  std::uint8_t detail{0};
  std::uint16_t session{0};
};
static_assert(sizeof(Record) == 32);

/// Bitwise equality: NaN equals itself and -0 differs from 0.
[[nodiscard]] bool same_bits(double a, double b) noexcept;

/// Detail of a record of kind `link`: bit 0 online, bit 1 written.
[[nodiscard]] constexpr std::uint8_t link_bits(const ControllerState& controller) noexcept {
  return static_cast<std::uint8_t>((controller.online ? 1u : 0u) | (controller.written ? 2u : 0u));
}
constexpr void set_link_bits(std::uint8_t bits, ControllerState& controller) noexcept {
  controller.online = (bits & 1u) != 0;
  controller.written = (bits & 2u) != 0;
}

/// Further data of a `measured` command; 0 in older histories. From bit 0: 2 bits of source, 30
/// bits of sd [nm], 30 bits of age [s].
inline constexpr std::uint32_t measured_part_max = (1u << 30) - 1u;
[[nodiscard]] constexpr std::int64_t measured_bits(const Command& command) noexcept {
  return static_cast<std::int64_t>(command.source) |
         static_cast<std::int64_t>(command.sd_nm & measured_part_max) << 2 |
         static_cast<std::int64_t>(command.ago_s & measured_part_max) << 32;
}
constexpr void set_measured_bits(std::int64_t bits, Command& command) noexcept {
  const auto part = [bits](int from) {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(bits) >> from) & measured_part_max;
  };
  command.source = static_cast<MeasuredSource>((part(0) & 3u) % measured_sources_count);
  command.sd_nm = part(2);
  command.ago_s = part(32);
}

/// Single producer (the cycle), single consumer (the writer). Wait-free on both sides, no
/// allocation after construction.
class RecordRing {
 public:
  /// @param capacity  records; rounded up to a power of two
  explicit RecordRing(std::size_t capacity = 65536);

  /// Producer. @return false when the ring is full: the record is dropped
  [[nodiscard]] bool try_push(const Record& record) noexcept;
  /// Producer: lower bound of the free places.
  [[nodiscard]] std::size_t free_places() const noexcept;
  /// Consumer: moves up to out.size() records into `out`. @return their number
  std::size_t pop(std::span<Record> out) noexcept;

  /// Producer: counts lost records; lost() may be called by any thread.
  void count_lost(std::uint64_t records) noexcept;
  [[nodiscard]] std::uint64_t lost() const noexcept;
  [[nodiscard]] std::size_t capacity() const noexcept { return mask_ + 1; }

 private:
  std::size_t mask_;
  std::unique_ptr<Record[]> records_;
  alignas(64) std::atomic<std::uint64_t> head_{0};  ///< written by the producer
  std::uint64_t tail_seen_{0};                      ///< the producer's copy of tail_
  alignas(64) std::atomic<std::uint64_t> tail_{0};  ///< written by the consumer
  alignas(64) std::atomic<std::uint64_t> lost_{0};
};

}  // namespace thermocomp
