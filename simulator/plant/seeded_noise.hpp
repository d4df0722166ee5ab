/// Noise as a pure function of (seed, stream, index), independent of when the plant is read.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace thermocomp {

/// Finaliser of splitmix64 over the three numbers. Source: Steele, Lea, Flood, "Fast splittable
/// pseudorandom number generators", OOPSLA 2014.
[[nodiscard]] inline std::uint64_t seeded_bits(std::uint64_t seed, std::uint64_t stream,
                                               std::uint64_t index) noexcept {
  const auto mix = [](std::uint64_t z) {
    z += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  };
  return mix(mix(mix(seed) ^ stream) ^ index);
}

/// Uniform in [0, 1).
[[nodiscard]] inline double seeded_uniform(std::uint64_t seed, std::uint64_t stream,
                                           std::uint64_t index) noexcept {
  return static_cast<double>(seeded_bits(seed, stream, index) >> 11) * 0x1.0p-53;
}

/// Normal, mean 0, standard deviation 1 (Box and Muller).
[[nodiscard]] inline double seeded_normal(std::uint64_t seed, std::uint64_t stream,
                                          std::uint64_t index) noexcept {
  const double u = 1.0 - seeded_uniform(seed, stream, 2 * index);
  const double v = seeded_uniform(seed, stream, 2 * index + 1);
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

}  // namespace thermocomp
