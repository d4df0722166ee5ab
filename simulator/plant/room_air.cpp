#include "simulator/plant/room_air.hpp"

#include <cmath>
#include <numbers>

#include "simulator/plant/seeded_noise.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t stream = 0x526F6F6Du;  // any number that no other part uses

}  // namespace

RoomAir::RoomAir(const RoomConfig& config, std::uint64_t seed)
    : config_(config), seed_(seed), wander_K_(config.wander_K * seeded_normal(seed, stream, 0)) {}

void RoomAir::step(double step_s) {
  const double keep = std::exp(-step_s / config_.wander_tau_s);
  ++steps_;
  wander_K_ = keep * wander_K_ + config_.wander_K * std::sqrt(1.0 - keep * keep) *
                                     seeded_normal(seed_, stream, steps_);
}

double RoomAir::temp_degC(double time_s) const {
  const double clock_h = config_.start_h + time_s / 3600.0;
  double temp = config_.mean_degC + wander_K_ +
                config_.daily_swing_K *
                    std::cos(2.0 * std::numbers::pi * (clock_h - config_.warmest_h) / 24.0);
  for (const DraughtConfig& draught : config_.draughts) {
    if (time_s >= draught.at_s && time_s < draught.at_s + draught.duration_s) {
      temp += draught.change_K;
    }
  }
  return temp;
}

}  // namespace thermocomp
