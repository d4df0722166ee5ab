#include "daemon/methods/reference_rules.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "daemon/status/temperature_trend.hpp"

namespace thermocomp {
namespace {

/// What is read back may be so far from nothing (as in AxisChannel), and no more is applied [um].
constexpr double at_nothing_um = 0.3;

void add(std::string& why, const std::string& reason) {
  why.append(why.empty() ? "" : "; ").append(reason);
}

/// What is in effect at the machine, by what is sent and by what is read back; of a dry run what
/// the controller applies by itself.
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

void add_axes(const StatusView& view, std::string& why) {
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) {
    const std::string& name = view.config.estimator.axes[i].name;
    if (view.report.axes[i].proving) {
      add(why, fmt::format("axis {} is being proved: wait until it has come back", name));
      continue;
    }
    const double um = in_effect_um(view, i);
    if (std::abs(um) > at_nothing_um)
      add(why, fmt::format("axis {} has an offset of {:+.2f}: the machine does not stand as it "
                           "would without one; `thermocomp disable`, and wait until it is zero",
                           name, um));
  }
}

/// The column that changes fastest is named; the others mostly follow it.
void add_warming(const StatusView& view, std::string& why) {
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
  add(why, fmt::format("{} changes by {:+.1f} K/h (over {}), more than {:.0f} K/h: the machine is "
                       "{}; wait until it is even",
                       name, fastest.rate_K_per_h, duration_min(fastest.span_s),
                       TemperatureTrend::even_rate_K_per_h_max,
                       fastest.rate_K_per_h > 0.0 ? "warming" : "cooling"));
}

}  // namespace

std::string why_no_reference(const StatusView& view) {
  std::string why;
  add_axes(view, why);
  add_warming(view, why);
  return why;
}

double watched_s(const StatusView& view) {
  if (view.trend == nullptr) return 0.0;
  double shortest_s = 1e-9 * static_cast<double>(TemperatureTrend::window.count());
  for (std::size_t i = 0; i < view.report.inputs.size(); ++i)
    shortest_s = std::min(
        shortest_s, view.trend->change(i, view.report.now, view.report.inputs[i].temp_degC).span_s);
  return shortest_s;
}

}  // namespace thermocomp
