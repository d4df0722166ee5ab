#include "daemon/cycle/duration_histogram.hpp"

#include <algorithm>
#include <bit>

namespace thermocomp {

std::size_t DurationHistogram::bucket_of(std::uint64_t ns) noexcept {
  if (ns < subs) return static_cast<std::size_t>(ns);
  const auto octave = static_cast<unsigned>(std::bit_width(ns)) - sub_bits - 1;
  const std::size_t bucket = subs * octave + static_cast<std::size_t>(ns >> octave);
  return std::min(bucket, subs * octaves - 1);
}

std::uint64_t DurationHistogram::upper_edge_ns(std::size_t bucket) noexcept {
  if (bucket < 2 * subs) return bucket;
  const std::size_t octave = bucket / subs - 1;
  return ((static_cast<std::uint64_t>(bucket - subs * octave) + 1) << octave) - 1;
}

void DurationHistogram::record(std::chrono::nanoseconds duration) noexcept {
  const auto ns = std::max<std::int64_t>(duration.count(), 0);
  // One writer: a load and a store are enough, and cheaper than an atomic addition.
  auto& bucket = buckets_[bucket_of(static_cast<std::uint64_t>(ns))];
  bucket.store(bucket.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (ns > max_ns_.load(std::memory_order_relaxed)) max_ns_.store(ns, std::memory_order_relaxed);
}

std::uint64_t DurationHistogram::count() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& bucket : buckets_) sum += bucket.load(std::memory_order_relaxed);
  return sum;
}

std::chrono::nanoseconds DurationHistogram::percentile(double fraction) const noexcept {
  const auto total = static_cast<double>(count());
  if (!(total > 0)) return {};
  double seen = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    seen += static_cast<double>(buckets_[i].load(std::memory_order_relaxed));
    if (seen >= fraction * total)
      return std::min(max(), std::chrono::nanoseconds(static_cast<std::int64_t>(upper_edge_ns(i))));
  }
  return max();
}

void DurationHistogram::clear() noexcept {
  for (auto& bucket : buckets_) bucket.store(0, std::memory_order_relaxed);
  max_ns_.store(0, std::memory_order_relaxed);
}

}  // namespace thermocomp
