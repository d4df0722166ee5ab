#include "gateway/feed/snapshot.hpp"

#include <cmath>

namespace thermocomp::gateway {

void TrendWatch::add(const std::string& name, double now_s, double value) {
  if (!std::isfinite(value)) return;
  std::deque<Sample>& samples = samples_[name];
  if (!samples.empty() && now_s - samples.back().at_s < sample_every_s) return;
  samples.push_back({now_s, value});
  while (now_s - samples.front().at_s > window_s) samples.pop_front();
}

double TrendWatch::per_hour(const std::string& name) const {
  const auto found = samples_.find(name);
  if (found == samples_.end()) return std::nan("");
  const std::deque<Sample>& samples = found->second;
  if (!(samples.back().at_s - samples.front().at_s >= known_after_s)) return std::nan("");
  double time_mean = 0.0;
  double value_mean = 0.0;
  for (const Sample& sample : samples) {
    time_mean += sample.at_s / static_cast<double>(samples.size());
    value_mean += sample.value / static_cast<double>(samples.size());
  }
  double along = 0.0;
  double across = 0.0;
  for (const Sample& sample : samples) {
    along += (sample.at_s - time_mean) * (sample.at_s - time_mean);
    across += (sample.at_s - time_mean) * (sample.value - value_mean);
  }
  constexpr double s_per_h = 3600.0;
  return along > 0.0 ? s_per_h * across / along : std::nan("");
}

}  // namespace thermocomp::gateway
