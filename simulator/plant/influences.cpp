#include "simulator/plant/influences.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/checks.hpp"
#include "simulator/plant/seeded_noise.hpp"

namespace thermocomp {

OperatingSignal::OperatingSignal(const SignalConfig& config, std::uint64_t seed,
                                 std::uint64_t stream)
    : config_(config), seed_(seed), stream_(stream) {
  const bool in_time = config.kind == SignalKind::steps || config.kind == SignalKind::line;
  const bool from_list = in_time || config.kind == SignalKind::random;
  THERMOCOMP_ENSURE(!from_list || !config.values.empty());
  THERMOCOMP_ENSURE(!in_time || config.times_s.size() == config.values.size());
  THERMOCOMP_ENSURE(config.kind != SignalKind::random || config.dwell_s_min > 0.0);
}

double OperatingSignal::value(double time_s, double watched) {
  switch (config_.kind) {
    case SignalKind::steps:
      return step_value(time_s);
    case SignalKind::line:
      return line_value(time_s);
    case SignalKind::random:
      return random_value(time_s);
    case SignalKind::sine:
      return config_.centre +
             config_.amplitude * std::sin(2.0 * std::numbers::pi * time_s / config_.period_s);
    case SignalKind::while_above:
      return watched > config_.above ? 1.0 : 0.0;
  }
  return 0.0;
}

double OperatingSignal::step_value(double time_s) const {
  const double t = config_.repeat_s > 0.0 ? std::fmod(time_s, config_.repeat_s) : time_s;
  const auto next = std::upper_bound(config_.times_s.begin(), config_.times_s.end(), t);
  const auto index = std::max<std::ptrdiff_t>(1, next - config_.times_s.begin()) - 1;
  return config_.values[static_cast<std::size_t>(index)];
}

double OperatingSignal::line_value(double time_s) const {
  const double t = config_.repeat_s > 0.0 ? std::fmod(time_s, config_.repeat_s) : time_s;
  const auto next = std::upper_bound(config_.times_s.begin(), config_.times_s.end(), t);
  if (next == config_.times_s.end()) return config_.values.back();
  const auto index = static_cast<std::size_t>(next - config_.times_s.begin());
  if (index == 0) return config_.values.front();
  const double begin_s = config_.times_s[index - 1];
  const double share = (t - begin_s) / (config_.times_s[index] - begin_s);
  return config_.values[index - 1] + share * (config_.values[index] - config_.values[index - 1]);
}

double OperatingSignal::random_value(double time_s) {
  while (changes_s_.empty() || changes_s_.back() <= time_s) {
    const double from = changes_s_.empty() ? 0.0 : changes_s_.back();
    const double u = seeded_uniform(seed_, stream_, 2 * changes_s_.size());
    changes_s_.push_back(from + config_.dwell_s_min +
                         u * (config_.dwell_s_max - config_.dwell_s_min));
  }
  const auto piece = static_cast<std::uint64_t>(
      std::upper_bound(changes_s_.begin(), changes_s_.end(), time_s) - changes_s_.begin());
  const std::uint64_t bits = seeded_bits(seed_, stream_, 2 * piece + 1);
  return config_.values[bits % config_.values.size()];
}

namespace {

constexpr std::uint64_t stream = 0x526F6F6Du;  // arbitrary, unique to this file

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
