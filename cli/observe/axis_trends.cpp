#include "cli/observe/axis_trends.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace thermocomp::cli {
namespace {

constexpr std::array<const char*, 8> wide_bars{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<const char*, 8> plain_bars{"_", ".", ":", "-", "=", "+", "*", "#"};
/// A smaller range is noise, and would look like movement.
constexpr double range_um_min = 0.5;
constexpr double still_um_per_min = 0.05;
constexpr double fast_um_per_min = 1.0;

}  // namespace

void AxisTrends::add(const Status& status) {
  const double now_s = status.uptime_s;
  if (!std::isfinite(now_s)) return;
  for (const AxisStatus& axis : status.axes) {
    std::deque<Sample>& samples = axes_[axis.name];
    // The daemon was started anew.
    if (!samples.empty() && now_s < samples.back().time_s) samples.clear();
    if (std::isfinite(axis.offset)) samples.push_back({now_s, axis.offset});
    while (!samples.empty() && samples.front().time_s < now_s - window_s) samples.pop_front();
  }
}

std::string AxisTrends::text(const std::string& axis) const {
  const auto found = axes_.find(axis);
  if (found == axes_.end() || found->second.size() < 2) return "";
  return bars(found->second) + " " + arrow(found->second);
}

std::string AxisTrends::bars(const std::deque<Sample>& samples) const {
  double low = samples.front().offset;
  double high = low;
  for (const Sample& sample : samples) {
    low = std::min(low, sample.offset);
    high = std::max(high, sample.offset);
  }
  const double middle = 0.5 * (low + high);
  const double range = std::max(range_um_min, high - low);
  const std::size_t count = std::min(cells, samples.size());
  std::string text;
  for (std::size_t cell = 0; cell < count; ++cell) {
    // The last value of each equal part, so that the newest one is always seen.
    const Sample& sample = samples[(cell + 1) * samples.size() / count - 1];
    // Apart from the middle of two levels, where what is still would flicker.
    const double height = 3.01 + 7.0 * (sample.offset - middle) / range;
    const auto level = static_cast<std::size_t>(std::clamp(std::lround(height), 0L, 7L));
    text += wide_ ? wide_bars.at(level) : plain_bars.at(level);
  }
  return text;
}

const char* AxisTrends::arrow(const std::deque<Sample>& samples) const {
  const double minutes = (samples.back().time_s - samples.front().time_s) / 60.0;
  const double rate =
      minutes > 0.0 ? (samples.back().offset - samples.front().offset) / minutes : 0.0;
  if (std::abs(rate) < still_um_per_min) return wide_ ? "→" : "steady";
  if (rate > 0.0) {
    if (rate < fast_um_per_min) return wide_ ? "↗" : "rising";
    return wide_ ? "↑" : "rising fast";
  }
  if (rate > -fast_um_per_min) return wide_ ? "↘" : "falling";
  return wide_ ? "↓" : "falling fast";
}

bool terminal_is_wide() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    std::string locale(value);
    std::transform(locale.begin(), locale.end(), locale.begin(), [](unsigned char c) {
      return static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
    });
    return locale.find("UTF-8") != std::string::npos || locale.find("UTF8") != std::string::npos;
  }
  return false;
}

}  // namespace thermocomp::cli
