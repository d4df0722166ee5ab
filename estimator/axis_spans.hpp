/// Which entries of EstimatorConfig::axes are one axis: an entry of its own, or the nodes of a
/// travel.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"

namespace thermocomp {

struct AxisSpan {
  std::size_t first{0};
  std::size_t count{1};

  [[nodiscard]] std::size_t end() const noexcept { return first + count; }
  bool operator==(const AxisSpan&) const = default;
};

/// The name that an operator calls it by.
[[nodiscard]] inline const std::string& axis_name(const AxisConfig& axis) noexcept {
  return axis.node ? axis.node->axis : axis.name;
}

/// In the order of the axes; together they are all entries.
[[nodiscard]] inline std::vector<AxisSpan> axis_spans(const std::vector<AxisConfig>& axes) {
  std::vector<AxisSpan> spans;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const bool goes_on =
        i > 0 && axes[i].node && axes[i - 1].node && axes[i].node->axis == axes[i - 1].node->axis;
    if (goes_on)
      ++spans.back().count;
    else
      spans.push_back({i, 1});
  }
  return spans;
}

/// The span that an entry is in. @pre entry < axes.size()
[[nodiscard]] inline AxisSpan span_of(const std::vector<AxisConfig>& axes, std::size_t entry) {
  for (const AxisSpan& span : axis_spans(axes))
    if (entry < span.end()) return span;
  return {entry, 1};
}

/// What a controller that interpolates makes of the values of a travel's nodes: straight between
/// two of them, the end's beyond the ends. No allocation.
/// @param nodes  entries of one span, each with a node
[[nodiscard]] inline double value_on_travel(std::span<const AxisConfig> nodes,
                                            std::span<const double> values,
                                            double position_mm) noexcept {
  std::size_t above = 1;
  while (above + 1 < nodes.size() && position_mm > nodes[above].node->position_mm) ++above;
  if (above >= nodes.size()) return values[0];
  const double low_mm = nodes[above - 1].node->position_mm;
  const double high_mm = nodes[above].node->position_mm;
  const double share = std::clamp((position_mm - low_mm) / (high_mm - low_mm), 0.0, 1.0);
  return (1.0 - share) * values[above - 1] + share * values[above];
}

}  // namespace thermocomp
