/// The ring between the cycle and the history's writer, on which neither side ever waits.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "daemon/recording/record.hpp"

namespace thermocomp {

/// Single producer (the cycle), single consumer (the writer). Wait-free on both sides, no
/// allocation after construction.
class RecordRing {
 public:
  /// @param capacity  records; rounded up to a power of two
  explicit RecordRing(std::size_t capacity = 65536);

  /// Producer. @return false when the ring is full; the record is then not in it
  [[nodiscard]] bool try_push(const Record& record) noexcept;
  /// Producer: free places, at least.
  [[nodiscard]] std::size_t free_places() const noexcept;
  /// Consumer: moves up to out.size() records into `out`. @return how many
  std::size_t pop(std::span<Record> out) noexcept;

  /// Producer: counts what could not be recorded. Any thread may ask how much that is.
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
