#include "daemon/status/reference_rules.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// Offsets up to this count as zero (as in AxisChannel) [um].
constexpr double at_nothing_um = 0.3;

/// The larger of sent offset and read-back [um]; in a dry run the offset reported by the
/// controller.
double in_effect_um(const DaemonConfig& config, const Report& report,
                    const ControllerHealth& controller, std::size_t i) {
  if (config.dry_run) {
    const auto& shown_um = controller.shown_um;
    return shown_um && std::isfinite((*shown_um)[i]) ? (*shown_um)[i] : 0.0;
  }
  const AxisReport& axis = report.axes[i];
  const bool is_read = std::isfinite(axis.applied_um);
  return is_read && std::abs(axis.applied_um) > std::abs(axis.offset_um) ? axis.applied_um
                                                                         : axis.offset_um;
}

std::string duration_min(double span_s) {
  return span_s < 120.0 ? fmt::format("{:.0f} s", span_s)
                        : fmt::format("{:.0f} min", span_s / 60.0);
}

/// Names the largest of the offsets.
void add_axes(const DaemonConfig& config, const Report& report, const ControllerHealth& controller,
              std::vector<std::string>& why) {
  std::size_t count = 0;
  double largest_um = 0.0;
  std::string largest;
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    const std::string& name = config.estimator.axes[i].name;
    const double um = in_effect_um(config, report, controller, i);
    if (report.axes[i].proving) {
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

struct NamedChange {
  std::string column;  ///< empty: the temperatures are steady, as far as known
  TemperatureTrend::Change change;
};

/// The column that changes fastest; others mostly follow it.
NamedChange fastest_change(const ThermalModel& model, const Report& report,
                           const TemperatureTrend& trend) {
  const auto columns = model.temperature_columns();
  NamedChange fastest;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto change = trend.change(i, report.now, report.inputs[i].temp_degC);
    if (!change.is_uneven()) continue;
    if (!fastest.column.empty() &&
        std::abs(change.rate_K_per_h) <= std::abs(fastest.change.rate_K_per_h))
      continue;
    fastest = {columns[i], change};
  }
  return fastest;
}

void add_warming(const ThermalModel& model, const Report& report, const TemperatureTrend* trend,
                 std::vector<std::string>& why) {
  if (trend == nullptr) return;
  const auto& [name, fastest] = fastest_change(model, report, *trend);
  if (name.empty()) return;
  why.push_back(fmt::format(
      "{} changes by {:+.1f} K/h (over {}), more than {:.0f} K/h: the machine is {}; wait until it "
      "is even",
      name, fastest.rate_K_per_h, duration_min(fastest.span_s),
      TemperatureTrend::even_rate_K_per_h_max, fastest.rate_K_per_h > 0.0 ? "warming" : "cooling"));
}

}  // namespace

std::string change_since_start(const ThermalModel& model, const Report& report,
                               const TemperatureTrend& trend) {
  const auto& [name, fastest] = fastest_change(model, report, trend);
  return name.empty() ? "" : fmt::format("{} {:+.1f} K/h", name, fastest.rate_K_per_h);
}

std::vector<std::string> lost_for_reference(const ThermalModel& model, const Report& report) {
  std::vector<std::string> lost;
  const auto columns = model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (!report.inputs[i].good) lost.push_back(columns[i] + " has no good sensor now");
  return lost;
}

std::vector<std::string> against_reference(const DaemonConfig& config, const Report& report,
                                           const ControllerHealth& controller,
                                           const TemperatureTrend* trend) {
  std::vector<std::string> why;
  add_axes(config, report, controller, why);
  // Without the controller it is held as during cutting.
  if (has_reason(report.reasons, Reason::cutting) &&
      !has_reason(report.reasons, Reason::controller_offline))
    why.emplace_back("the controller reports cutting: wait for the end of the cut");
  add_warming(config.model, report, trend, why);
  return why;
}

double watched_s(const Report& report, const TemperatureTrend* trend) {
  if (trend == nullptr) return 0.0;
  double shortest_s = to_seconds(TemperatureTrend::window);
  for (std::size_t i = 0; i < report.inputs.size(); ++i)
    shortest_s =
        std::min(shortest_s, trend->change(i, report.now, report.inputs[i].temp_degC).span_s);
  return shortest_s;
}

}  // namespace thermocomp
