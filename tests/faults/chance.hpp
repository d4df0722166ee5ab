/// Seeded random numbers, identical on every machine and standard library.
#pragma once

#include <cstddef>
#include <cstdint>

namespace thermocomp::faults {

/// SplitMix64 (Steele, Lea, Flood 2014): a short multiplication chain, sufficient to draw faults.
[[nodiscard]] constexpr std::uint64_t scramble(std::uint64_t value) noexcept {
  value += 0x9E3779B97F4A7C15u;
  value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9u;
  value = (value ^ (value >> 27)) * 0x94D049BB133111EBu;
  return value ^ (value >> 31);
}

class Chance {
 public:
  explicit Chance(std::uint64_t seed) noexcept : state_(scramble(seed)) {}
  /// A separate stream for a part of a life, so that changes in one part do not affect another.
  Chance(std::uint64_t seed, std::uint64_t part) noexcept : Chance(seed * 1000003u + part) {}

  [[nodiscard]] std::uint64_t next() noexcept { return scramble(state_ += 0xD1342543DE82EF95u); }
  [[nodiscard]] double fraction() noexcept { return static_cast<double>(next() >> 11) * 0x1p-53; }
  [[nodiscard]] double between(double low, double high) noexcept {
    return low + (high - low) * fraction();
  }
  [[nodiscard]] bool one_in(std::uint64_t count) noexcept { return next() % count == 0; }
  [[nodiscard]] std::size_t below(std::size_t count) noexcept {
    return static_cast<std::size_t>(next() % count);
  }

 private:
  std::uint64_t state_;
};

}  // namespace thermocomp::faults
