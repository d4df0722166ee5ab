#include <array>
#include <cmath>

#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

/// P = 1 / (1 + (even / score)^steepness): half at `even`.
struct Worth {
  std::string_view kind;
  double even;
  double steepness;
};
constexpr std::array<Worth, 8> worths{{
    {"spikes", 1.15, 8},
    {"outliers", 1.15, 8},
    {"sensor_step", 8.0, 6},
    {"sensor_drift", 10.0, 6},
    {"sensor_loose", 22.0, 6},
    {"sensor_swap", 2.0, 4},
    {"stuck", 2.0, 3},
    {"displacement_step", 10.0, 6},
}};
constexpr double of_plain_facts = 0.99;  // coarse, copy, gap, clock: they stand in the file

}  // namespace

double probability_of(const std::string& kind, double score) {
  for (const Worth& worth : worths)
    if (worth.kind == kind)
      return of_plain_facts / (1.0 + std::pow(worth.even / std::max(score, 1e-9), worth.steepness));
  return of_plain_facts;
}

}  // namespace thermocomp::inspection
