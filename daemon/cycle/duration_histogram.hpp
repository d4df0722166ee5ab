/// How long something took, over millions of times: percentiles to 1.6 % without keeping samples.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace thermocomp {

/// One writer counts, any thread reads. Buckets: 64 per factor of two, from 1 ns to 18 minutes.
/// Wait-free, no allocation.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void record(std::chrono::nanoseconds duration) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  /// @param fraction  0..1, e.g. 0.999 for the 99.9th percentile
  /// @return upper edge of the bucket in which it lies; 0 while empty
  [[nodiscard]] std::chrono::nanoseconds percentile(double fraction) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds max() const noexcept {
    return std::chrono::nanoseconds(max_ns_.load(std::memory_order_relaxed));
  }
  /// Starts anew; readers may see a mixture for a moment.
  void clear() noexcept;

 private:
  static constexpr unsigned sub_bits = 6;
  static constexpr std::size_t subs = std::size_t{1} << sub_bits;
  static constexpr std::size_t octaves = 35;

  [[nodiscard]] static std::size_t bucket_of(std::uint64_t ns) noexcept;
  [[nodiscard]] static std::uint64_t upper_edge_ns(std::size_t bucket) noexcept;

  std::array<std::atomic<std::uint32_t>, subs * octaves> buckets_{};
  std::atomic<std::int64_t> max_ns_{0};
};

}  // namespace thermocomp
