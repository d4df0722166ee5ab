/// Random configuration and model of the machine in a life of the estimator.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::property {

inline constexpr std::size_t axes_count = 3;
inline constexpr std::size_t sensors_count = 6;

/// A random stream for each part of the world, so that withholding readings does not change the
/// controller's or operator's actions.
class Chance {
 public:
  Chance(std::uint64_t seed, std::uint64_t part) : engine_(seed * 1000003u + part) {}
  // std::uniform_*_distribution differs between standard libraries.
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  bool one_in(std::uint64_t count) { return engine_() % count == 0; }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(engine_() % count); }

 private:
  std::mt19937_64 engine_;
};

[[nodiscard]] EstimatorConfig random_config(Chance& chance);
[[nodiscard]] ThermalModel random_model(Chance& chance);
/// The controller interpolates z: the y axis becomes the node at the other end.
void lay_out_travel(Chance& chance, EstimatorConfig& config, ThermalModel& model);

}  // namespace thermocomp::property
