#include <algorithm>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp {
namespace {

template <class Entries>
std::vector<std::string> names_of(const Entries& entries) {
  std::vector<std::string> names;
  names.reserve(entries.size());
  for (const auto& entry : entries) names.push_back(entry.name);
  return names;
}

/// Names of added, removed and changed buses.
void compare_buses(const std::vector<BusConfig>& running, const std::vector<BusConfig>& next,
                   std::vector<std::string>& changed) {
  const auto missing_in = [](const std::vector<BusConfig>& buses, const BusConfig& bus) {
    return std::find(buses.begin(), buses.end(), bus) == buses.end();
  };
  std::vector<std::string> names;
  for (const BusConfig& bus : running) {
    if (missing_in(next, bus)) names.push_back(name_of(bus));
  }
  for (const BusConfig& bus : next) {
    const bool named = std::find(names.begin(), names.end(), name_of(bus)) != names.end();
    if (missing_in(running, bus) && !named) names.push_back(name_of(bus));
  }
  for (const std::string& name : names) changed.push_back("bus " + name);
  if (names.empty() && !(running == next)) changed.emplace_back("order of the buses");
}

bool same_signs(const std::vector<AxisConfig>& a, const std::vector<AxisConfig>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const AxisConfig& x, const AxisConfig& y) { return x.sign == y.sign; });
}

}  // namespace

std::vector<std::string> restart_needed(const DaemonConfig& running, const DaemonConfig& next) {
  std::vector<std::string> changed;
  const auto compare = [&](bool same, const char* what) {
    if (!same) changed.emplace_back(what);
  };
  compare(running.loop == next.loop, "loop");
  compare(names_of(running.estimator.sensors) == names_of(next.estimator.sensors),
          "names or order of the sensors");
  compare_buses(running.buses, next.buses, changed);
  compare(names_of(running.estimator.axes) == names_of(next.estimator.axes),
          "names, count or order of the axes");
  // The meaning of applied and displayed values would change during the reload.
  compare(same_signs(running.estimator.axes, next.estimator.axes), "sign of an axis");
  compare(running.controller == next.controller, "controller, or registers of the axes");
  compare(running.dry_run == next.dry_run, "dry_run of the controller");
  compare(running.estimator.signals == next.estimator.signals, "signals of the controller");
  compare(running.history == next.history, "history");
  compare(running.socket == next.socket, "socket");
  compare(running.state_file == next.state_file, "state_file");
  return changed;
}

}  // namespace thermocomp
