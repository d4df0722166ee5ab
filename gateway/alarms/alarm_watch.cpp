#include "gateway/alarms/alarm_watch.hpp"

#include <algorithm>
#include <set>

#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

/// Duration of a start, with the default settle_s: values are confirmed and the link is up.
constexpr double beginning_s = 60.0;

/// True at start-up, while values are not yet confirmed.
bool begins(const Status& status) {
  double settle_s = 0.0;
  for (const Confirmation& values : status.confirming)
    settle_s = std::max(settle_s, values.settle_s);
  return status.mode == Mode::starting && status.sensors_bad.empty() &&
         !(status.mode_since_s > std::max(beginning_s, 2.0 * settle_s));
}

void add_compensation(const Status& status, std::vector<AlarmCondition>& wrong) {
  const Verdict now = verdict(status);
  if (now.compensating) return;
  if (begins(status)) return;
  // A dry run that computes is intended and may last for days.
  if (status.dry_run && status.mode == Mode::compensating) return;
  AlarmCondition condition{"compensation", "compensating: " + verdict_text(now), ""};
  const std::vector<Reason> reasons = by_severity(status.reasons);
  if (!reasons.empty()) condition.remedy = std::string(code_text(reasons.front()).remedy);
  wrong.push_back(std::move(condition));
}

/// Adds one alarm per disconnected bus or silent module, in place of one per sensor.
/// @return the sensors on it
std::set<std::string> add_buses(const Status& status, std::vector<AlarmCondition>& wrong) {
  std::set<std::string> away;
  for (const BusStatus& bus : status.buses) {
    if (!bus.connected)
      wrong.push_back({"bus/" + bus.name,
                       "bus " + bus.name + " is not connected (" + bus.last_error + ")",
                       std::string(bus_remedy(bus.kind))});
    for (const UnitStatus& unit : bus.units) {
      if (bus.connected && unit.answering) continue;
      away.insert(unit.sensors.begin(), unit.sensors.end());
      if (bus.connected)
        wrong.push_back({"unit/" + unit.name,
                         unit.name + " on " + bus.name + " does not answer: without sensors " +
                             joined(unit.sensors),
                         std::string(code_text(Fault::no_answer).remedy)});
    }
  }
  return away;
}

/// @param away  sensors whose bus or module has its own alarm
void add_sensors(const SensorsAnswer& answer, const std::set<std::string>& away,
                 std::vector<AlarmCondition>& wrong) {
  for (const SensorStatus& sensor : answer.sensors) {
    const CodeText fault = fault_text(sensor);
    if (sensor.fault != Fault::none && !settles(sensor) && away.count(sensor.name) == 0)
      wrong.push_back({"sensor/" + sensor.name,
                       "sensor " + sensor.name + ": " + std::string(fault.meaning),
                       std::string(fault.remedy)});
    if (sensor.suspected)
      wrong.push_back({"suspected/" + sensor.name,
                       "sensor " + sensor.name + " is off by " +
                           fixed_signed(sensor.suspected->size_K, 1) + " K against its neighbours",
                       "check its contact and its place"});
  }
}

}  // namespace

std::vector<AlarmCondition> active_conditions(const Snapshot& snapshot) {
  std::vector<AlarmCondition> wrong;
  if (!snapshot.is_here) {
    wrong.push_back({"daemon", "the daemon does not answer: " + snapshot.why,
                     "systemctl status thermocompd; journalctl -u thermocompd"});
    return wrong;
  }
  const Status& status = snapshot.status;
  add_compensation(status, wrong);
  const std::set<std::string> away = add_buses(status, wrong);
  add_sensors(snapshot.sensors, away, wrong);
  for (const FrozenModule& module : status.modules_frozen)
    wrong.push_back({"frozen/" + module.name,
                     "device " + module.name + " repeats its values, which were noisy: frozen?",
                     std::string(frozen_remedy)});
  for (const AxisStatus& axis : status.axes)
    if (axis.at_bound)
      wrong.push_back({"bound/" + axis.name, "axis " + axis.name + " is at its bound",
                       std::string(code_text(Reason::at_bound).remedy)});
  const CodeText domain = code_text(Reason::outside_domain);
  if (status.model.outside.value_or(false))
    wrong.push_back({"domain", std::string(domain.meaning), std::string(domain.remedy)});
  return wrong;
}

bool is_judged(const Snapshot& snapshot) {
  return snapshot.is_here && !begins(snapshot.status);
}

std::vector<AlarmChange> AlarmWatch::update(double now_s, const std::vector<AlarmCondition>& wrong,
                                            bool is_known) {
  std::set<std::string> named;
  for (const AlarmCondition& condition : wrong) {
    named.insert(condition.name);
    Place& place = places_[condition.name];
    if (!place.is_wrong) place.turned_s = now_s;
    if (!place.is_raised && !place.is_wrong) place.alarm.since_s = now_s;
    place.is_wrong = true;
    place.alarm.condition = condition;
  }
  std::vector<AlarmChange> changes;
  for (auto entry = places_.begin(); entry != places_.end();) {
    Place& place = entry->second;
    const bool may_turn = is_known || entry->first == "daemon";
    if (place.is_wrong && may_turn && named.count(entry->first) == 0) {
      place.is_wrong = false;
      place.turned_s = now_s;
    }
    const double lasts_s = now_s - place.turned_s;
    const bool is_seen = named.count(entry->first) > 0;
    if (is_seen && !place.is_raised && lasts_s >= raise_after_s_) {
      place.is_raised = true;
      changes.push_back({true, place.alarm});
    }
    if (!place.is_wrong && place.is_raised && lasts_s >= clear_after_s_) {
      place.is_raised = false;
      changes.push_back({false, place.alarm});
    }
    entry = !place.is_wrong && !place.is_raised ? places_.erase(entry) : std::next(entry);
  }
  return changes;
}

std::vector<Alarm> AlarmWatch::active() const {
  std::vector<Alarm> list;
  for (const auto& [name, place] : places_)
    if (place.is_raised) list.push_back(place.alarm);
  return list;
}

}  // namespace thermocomp::gateway
