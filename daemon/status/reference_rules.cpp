#include "daemon/status/reference_rules.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "daemon/status/warm_up.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// Offsets up to this count as zero (as in AxisChannel) [um].
constexpr double at_nothing_um = 0.3;

/// The larger of sent offset and read-back [um]; in a dry run the offset shown by the controller.
double in_effect_um(const StatusView& view, std::size_t i) {
  if (view.config.dry_run) {
    const auto& shown_um = view.controller_health.shown_um;
    return shown_um && std::isfinite((*shown_um)[i]) ? (*shown_um)[i] : 0.0;
  }
  const AxisReport& axis = view.report.axes[i];
  const bool is_read = std::isfinite(axis.applied_um);
  return is_read && std::abs(axis.applied_um) > std::abs(axis.offset_um) ? axis.applied_um
                                                                         : axis.offset_um;
}

std::string duration_min(double span_s) {
  return span_s < 120.0 ? fmt::format("{:.0f} s", span_s)
                        : fmt::format("{:.0f} min", span_s / 60.0);
}

/// Names the largest of the offsets.
void add_axes(const StatusView& view, std::vector<std::string>& why) {
  std::size_t count = 0;
  double largest_um = 0.0;
  std::string largest;
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) {
    const std::string& name = view.config.estimator.axes[i].name;
    const double um = in_effect_um(view, i);
    if (view.report.axes[i].proving) {
      why.push_back(fmt::format("axis {} is being proved: wait until it has returned", name));
    } else if (std::abs(um) > at_nothing_um) {
      ++count;
      if (std::abs(um) <= std::abs(largest_um)) continue;
      largest_um = um;
      largest = name;
    }
  }
  if (count == 0) return;
  const std::string more = count > 1 ? fmt::format(" (the largest of {} axes)", count) : "";
  why.push_back(fmt::format(
      "axis {} has an offset of {:+.2f}{}: switch the compensation off, and wait until it is zero",
      largest, largest_um, more));
}

/// Names the column that changes fastest; the others mostly follow it.
void add_warming(const StatusView& view, std::vector<std::string>& why) {
  if (view.trend == nullptr) return;
  const auto columns = view.config.model.temperature_columns();
  TemperatureTrend::Change fastest;
  std::string name;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto change = view.trend->change(i, view.report.now, view.report.inputs[i].temp_degC);
    if (!change.is_uneven()) continue;
    if (!name.empty() && std::abs(change.rate_K_per_h) <= std::abs(fastest.rate_K_per_h)) continue;
    fastest = change;
    name = columns[i];
  }
  if (name.empty()) return;
  why.push_back(fmt::format(
      "{} changes by {:+.1f} K/h (over {}), more than {:.0f} K/h: the machine is {}; wait until it "
      "is even",
      name, fastest.rate_K_per_h, duration_min(fastest.span_s),
      TemperatureTrend::even_rate_K_per_h_max, fastest.rate_K_per_h > 0.0 ? "warming" : "cooling"));
}

}  // namespace

std::vector<std::string> lost_for_reference(const StatusView& view) {
  std::vector<std::string> lost;
  const auto columns = view.config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (!view.report.inputs[i].good) lost.push_back(columns[i] + " has no good sensor now");
  return lost;
}

std::vector<std::string> against_reference(const StatusView& view) {
  std::vector<std::string> why;
  add_axes(view, why);
  // Without the controller it is held as if it were cutting.
  if (has_reason(view.report.reasons, Reason::cutting) &&
      !has_reason(view.report.reasons, Reason::controller_offline))
    why.emplace_back("the controller reports cutting: wait for the end of the cut");
  add_warming(view, why);
  return why;
}

double watched_s(const StatusView& view) {
  if (view.trend == nullptr) return 0.0;
  double shortest_s = to_seconds(TemperatureTrend::window);
  for (std::size_t i = 0; i < view.report.inputs.size(); ++i)
    shortest_s = std::min(
        shortest_s, view.trend->change(i, view.report.now, view.report.inputs[i].temp_degC).span_s);
  return shortest_s;
}

}  // namespace thermocomp
