#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <nlohmann/json.hpp>

#include "estimator/types.hpp"
#include "gateway/feed/page_state.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

/// An effect begins at most this much before its cause begins or after it ends.
constexpr double near_s = 5.0;
constexpr double unknown_end_s = std::numeric_limits<double>::infinity();

/// Causes come before their effects: a link before its sensors, these before inputs of the model
/// and reasons, all of these and commands before the mode.
enum class Rank { link, sensor, input, order, mode, alone };

Rank rank_of(const Event& event) {
  if (event.kind == EventKind::mode) return Rank::mode;
  if (event.kind == EventKind::command || event.kind == EventKind::daemon) return Rank::order;
  switch (event.subject.kind) {
    case SubjectKind::bus:
    case SubjectKind::device:
    case SubjectKind::controller:
      return Rank::link;
    case SubjectKind::sensor:
      return Rank::sensor;
    case SubjectKind::input:
    case SubjectKind::estimate:
      return Rank::input;
    case SubjectKind::reason: {
      const std::optional<Reason> reason = reason_named(event.code);
      const bool has_cause = reason == Reason::block_lost || reason == Reason::block_estimated ||
                             reason == Reason::sensor_unconfirmed ||
                             reason == Reason::controller_offline || reason == Reason::not_written;
      return reason == Reason::operator_disabled ? Rank::mode
             : has_cause                         ? Rank::input
                                                 : Rank::alone;
    }
    default:
      return Rank::alone;
  }
}

bool is_start(const Event& event) {
  return event.kind == EventKind::daemon && event.code == "started";
}

/// End of the run before a start; if unknown, the start.
double absent_since_s(const Event& start) {
  return start.wall_s - (std::isfinite(start.duration_s) ? start.duration_s : 0.0);
}

/// From the first fault of a subject to its recovery or the daemon's end; of other events a moment.
struct Outage {
  const Event* first{nullptr};
  Rank rank{Rank::alone};
  double from_s{0.0};
  double to_s{unknown_end_s};
};

/// @param of_event  index of each event's outage
std::vector<Outage> outages_of(const std::vector<Event>& events,
                               std::vector<std::size_t>& of_event) {
  std::vector<Outage> outages;
  std::map<Subject, std::size_t> open;
  for (const Event& event : events) {
    if (is_start(event)) {  // present faults are reported again
      for (const auto& [subject, known] : open) outages[known].to_s = absent_since_s(event);
      open.clear();
    }
    const bool ends = event.kind == EventKind::recovery;
    const auto known = open.find(event.subject);
    if ((ends || event.kind == EventKind::fault) && known != open.end()) {
      of_event.push_back(known->second);
    } else {
      of_event.push_back(outages.size());
      // An outage may begin before the oldest event.
      outages.push_back(
          {&event, rank_of(event), ends ? event.wall_s - event.duration_s : event.wall_s});
      if (event.kind == EventKind::fault) open[event.subject] = of_event.back();
      if (event.kind != EventKind::fault) outages.back().to_s = event.wall_s;
    }
    if (!ends) continue;
    outages[of_event.back()].to_s = event.wall_s;
    open.erase(event.subject);
  }
  return outages;
}

/// The outage of lowest rank that existed when `outage` began and ranks below it; nullptr: none.
const Outage* cause_of(const Outage& outage, const std::vector<Outage>& all) {
  const Outage* cause = nullptr;
  for (const Outage& other : all) {
    const bool explains = other.rank < outage.rank && outage.rank != Rank::order &&
                          outage.rank != Rank::alone && outage.from_s >= other.from_s - near_s &&
                          outage.from_s <= other.to_s + near_s;
    if (explains && (cause == nullptr || other.rank < cause->rank)) cause = &other;
  }
  return cause;
}

/// Events shown as one entry because they repeat.
struct Group {
  const Event* newest{nullptr};
  std::size_t times{0};
  double lasted_s{0.0};
  double idle_s{0.0};  ///< time without compensation caused by it
};

bool is_outage(const Event& event) {
  return event.kind == EventKind::fault || event.kind == EventKind::recovery;
}

bool is_same(const Event& a, const Event& b) {
  if (&a == &b) return true;
  if (a.subject != b.subject || a.code != b.code) return false;
  return is_outage(a) ? is_outage(b) : a.kind == EventKind::mode && b.kind == a.kind;
}

/// @param lasts  the outage continues
std::string text_of(const Group& group, bool lasts) {
  std::string text = page_event_text(*group.newest);
  if (group.times > 1) {
    if (group.newest->kind == EventKind::recovery) text.erase(text.rfind(": over"));
    text += ": " + std::to_string(group.times) + " times";
    if (group.lasted_s > 0.0) text += ", " + duration_text(group.lasted_s) + " in all";
    if (lasts && group.newest->kind == EventKind::fault) text += ", and still";
  }
  return group.idle_s > 0.0 ? text + "; not compensated for " + duration_text(group.idle_s) : text;
}

/// Duration of the mode without compensation that this event ended; 0 for other events.
double idle_s(const Event& event) {
  const bool counts = event.kind == EventKind::mode && std::isfinite(event.duration_s) &&
                      event.code == to_string(Mode::compensating) &&
                      event.subject.name != to_string(Mode::starting);
  return counts ? event.duration_s : 0.0;
}

}  // namespace

std::string_view command_name(std::string_view method) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> names{
      {{"enable", "switch on"},
       {"disable", "switch off"},
       {"reference", "take the reference"},
       {"prove", "prove axis"},
       {"accept", "accept sensor"}}};
  for (const auto& [known, name] : names)
    if (known == method) return name;
  return method;
}

std::string page_event_text(const Event& event) {
  std::string text = event_text(event);
  if (event.kind == EventKind::command && text.starts_with(event.code))
    text.replace(0, event.code.size(), command_name(event.code));
  return text;
}

json page_events(const Snapshot& snapshot, std::size_t most) {
  const std::vector<Event>& events = *snapshot.events;
  std::vector<std::size_t> of_event;
  const std::vector<Outage> outages = outages_of(events, of_event);
  std::vector<Group> groups;
  const auto group_of = [&groups](const Event& event) {
    return std::find_if(groups.begin(), groups.end(),
                        [&](const Group& known) { return is_same(*known.newest, event); });
  };
  std::vector<std::pair<const Event*, double>> idle;  // cause and duration
  for (std::size_t i = events.size(); i-- > 0;) {
    const Event& event = events[i];
    const bool is_next_start = i + 1 < events.size() && is_start(events[i + 1]);
    if (event.kind == EventKind::daemon && event.code == "stopping" && is_next_start) continue;
    if (const Outage* cause = cause_of(outages[of_event[i]], outages)) {
      idle.emplace_back(cause->first, idle_s(event));
      continue;
    }
    auto group = group_of(event);
    if (group == groups.end()) group = groups.insert(group, {&event});
    // An outage counts once, by its fault, which may be older than the list.
    if (event.kind != EventKind::recovery) ++group->times;
    if (event.kind == EventKind::recovery) group->lasted_s += event.duration_s;
  }
  for (const auto& [first, lasted_s] : idle) {
    const auto group = group_of(*first);
    if (group != groups.end()) group->idle_s += lasted_s;
  }
  json list = json::array();
  for (const Group& group : groups) {
    if (list.size() == most) break;
    const Event& event = *group.newest;
    const auto place = static_cast<std::size_t>(&event - events.data());
    const bool lasts = outages[of_event[place]].to_s == unknown_end_s;
    json entry = {{"number", event.number},
                  {"wall_s", event.wall_s},
                  {"kind", to_string(event.kind)},
                  {"text", text_of(group, lasts)}};
    if (is_start(event) && std::isfinite(event.duration_s)) {
      const bool was_stopped = place > 0 && events[place - 1].code == "stopping";
      entry["text"] = was_stopped ? "daemon stopped" : "daemon killed, or the power failed";
      entry["from_s"] = absent_since_s(event);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace thermocomp::gateway
