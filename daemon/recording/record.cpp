#include "daemon/recording/record.hpp"

#include <algorithm>
#include <bit>

namespace thermocomp {

std::string_view to_string(SegmentReason reason) noexcept {
  switch (reason) {
    case SegmentReason::start:
      return "start";
    case SegmentReason::reload:
      return "reload";
    case SegmentReason::periodic:
      return "periodic";
    case SegmentReason::gap:
      return "gap";
  }
  return "unknown";
}

bool same_bits(double a, double b) noexcept {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

RecordRing::RecordRing(std::size_t capacity)
    : mask_(std::bit_ceil(std::max<std::size_t>(capacity, 2)) - 1),
      records_(std::make_unique<Record[]>(mask_ + 1)) {}

bool RecordRing::try_push(const Record& record) noexcept {
  const std::uint64_t head = head_.load(std::memory_order_relaxed);
  if (head - tail_seen_ > mask_) {
    tail_seen_ = tail_.load(std::memory_order_acquire);
    if (head - tail_seen_ > mask_) return false;
  }
  records_[head & mask_] = record;
  head_.store(head + 1, std::memory_order_release);
  return true;
}

std::size_t RecordRing::free_places() const noexcept {
  const std::uint64_t head = head_.load(std::memory_order_relaxed);
  return mask_ + 1 - static_cast<std::size_t>(head - tail_.load(std::memory_order_acquire));
}

std::size_t RecordRing::pop(std::span<Record> out) noexcept {
  const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
  const std::uint64_t head = head_.load(std::memory_order_acquire);
  const std::size_t count =
      std::min<std::size_t>(static_cast<std::size_t>(head - tail), out.size());
  for (std::size_t i = 0; i < count; ++i) out[i] = records_[(tail + i) & mask_];
  tail_.store(tail + count, std::memory_order_release);
  return count;
}

void RecordRing::count_lost(std::uint64_t records) noexcept {
  lost_.fetch_add(records, std::memory_order_relaxed);
}

std::uint64_t RecordRing::lost() const noexcept {
  return lost_.load(std::memory_order_relaxed);
}

}  // namespace thermocomp
