#include "gateway/alarms/alarm_watch.hpp"

#include <set>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/observe/troubles.hpp"

namespace thermocomp::gateway {
namespace {

using cli::flag_of;
using cli::list_of;
using cli::object_of;
using cli::text_of;
using nlohmann::json;

void add_compensation(const json& status, std::vector<AlarmCondition>& wrong) {
  const cli::Verdict verdict = cli::verdict(status);
  if (verdict.compensating) return;
  // A dry run that computes is what somebody wants, for days.
  if (text_of(status, "mode") == "dry_run") return;
  AlarmCondition condition{"compensation", "compensating: " + verdict.answer + verdict.detail, ""};
  for (const json& reason : list_of(status, "reasons"))
    if (reason.is_string() && condition.remedy.empty())
      condition.remedy = std::string(cli::reason_text(reason.get<std::string>()).remedy);
  wrong.push_back(std::move(condition));
}

void add_sensors(const json& sensors, std::vector<AlarmCondition>& wrong) {
  for (const json& sensor : list_of(sensors, "sensors")) {
    const std::string name = text_of(sensor, "name");
    const cli::ReasonText fault = cli::fault_text(text_of(sensor, "fault"));
    if (fault.name != "none")
      wrong.push_back({"sensor/" + name, "sensor " + name + ": " + std::string(fault.meaning),
                       std::string(fault.remedy)});
    const json& suspected = object_of(sensor, "suspected");
    if (!suspected.empty())
      wrong.push_back({"suspected/" + name,
                       "sensor " + name + " is off by " +
                           cli::fixed_signed(cli::number_of(suspected, "size_K"), 1) +
                           " K against its neighbours",
                       "check its contact and its place"});
  }
}

}  // namespace

std::vector<AlarmCondition> wrong_now(const Snapshot& snapshot) {
  std::vector<AlarmCondition> wrong;
  if (!snapshot.is_here) {
    wrong.push_back({"daemon", "the daemon does not answer: " + snapshot.why,
                     "systemctl status thermocompd; journalctl -u thermocompd"});
    return wrong;
  }
  const json& status = snapshot.status;
  add_compensation(status, wrong);
  add_sensors(snapshot.sensors, wrong);
  for (const json& axis : list_of(status, "axes"))
    if (flag_of(axis, "at_bound"))
      wrong.push_back({"bound/" + text_of(axis, "name"),
                       "axis " + text_of(axis, "name") + " is at its bound",
                       std::string(cli::reason_text("at_bound").remedy)});
  const cli::ReasonText domain = cli::reason_text("outside_domain");
  if (flag_of(object_of(status, "model"), "outside"))
    wrong.push_back({"domain", std::string(domain.meaning), std::string(domain.remedy)});
  for (const json& bus : list_of(status, "buses"))
    if (!flag_of(bus, "connected"))
      wrong.push_back(
          {"bus/" + text_of(bus, "name"),
           "bus " + text_of(bus, "name") + " is not connected (" + text_of(bus, "last_error") + ")",
           std::string(cli::bus_remedy(text_of(bus, "kind")))});
  return wrong;
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
    if (place.is_wrong && !place.is_raised && lasts_s >= raise_after_s_) {
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
