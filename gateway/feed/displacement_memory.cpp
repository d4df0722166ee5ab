#include "gateway/feed/displacement_memory.hpp"

#include <cmath>

namespace thermocomp::gateway {

void DisplacementMemory::add(double wall_s, const std::vector<AxisStatus>& now) {
  std::vector<std::string> axes;
  Sample sample{wall_s, {}};
  for (const AxisStatus& axis : now) {
    axes.push_back(axis.name);
    sample.values.push_back(static_cast<float>(axis.displacement));
  }
  // A clock that was set back: what was noted "later" has no place any more.
  const bool went_back = !samples_.empty() && wall_s < samples_.back().wall_s;
  if (axes != axes_ || went_back) samples_.clear();
  axes_ = std::move(axes);
  if (!samples_.empty() && wall_s - samples_.back().wall_s < sample_every_s) return;
  samples_.push_back(std::move(sample));
  if (samples_.size() > samples_max) samples_.pop_front();
}

std::vector<double> DisplacementMemory::over(std::size_t axis, const std::vector<double>& times_s,
                                             double span_s) const {
  std::vector<double> sums(times_s.size(), 0.0);
  std::vector<std::size_t> counts(times_s.size(), 0);
  for (const Sample& sample : samples_) {
    if (times_s.empty() || !std::isfinite(sample.values[axis])) continue;
    const double place = std::floor((sample.wall_s - times_s.front()) / span_s + 0.5);
    if (!(place >= 0.0 && place < static_cast<double>(times_s.size()))) continue;
    sums[static_cast<std::size_t>(place)] += static_cast<double>(sample.values[axis]);
    ++counts[static_cast<std::size_t>(place)];
  }
  for (std::size_t i = 0; i < sums.size(); ++i)
    sums[i] = counts[i] > 0 ? sums[i] / static_cast<double>(counts[i]) : std::nan("");
  return sums;
}

}  // namespace thermocomp::gateway
