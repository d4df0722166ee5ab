#include "daemon/status/event_journal.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/types.hpp"

namespace thermocomp {
namespace {

double seconds(std::chrono::nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

bool is_same_fault(const Event& a, const Event& b) {
  const bool is_same_value = a.value == b.value || (std::isnan(a.value) && std::isnan(b.value));
  return a.code == b.code && a.detail == b.detail && is_same_value;
}

}  // namespace

EventJournal::Moment EventJournal::system_now() {
  return {std::chrono::steady_clock::now().time_since_epoch(),
          std::chrono::system_clock::now().time_since_epoch()};
}

void EventJournal::add(const Moment& at, Event event) {
  event.number = ++number_;
  event.wall_s = seconds(at.wall);
  if (listener_) listener_(event);
  events_.push_back(std::move(event));
  if (events_.size() > kept_max) events_.pop_front();
}

bool EventJournal::fault(Event fault) {
  const Moment at = now_();
  fault.kind = EventKind::fault;
  const auto known = outages_.find(fault.subject);
  if (known != outages_.end() && is_over(known->second, at.monotonic)) outages_.erase(known);
  Outage& outage = outages_.try_emplace(fault.subject).first->second;
  if (outage.reported.empty()) outage.since = at.monotonic;
  outage.newest = fault;
  const bool is_back = std::exchange(outage.away_since, std::nullopt).has_value();
  const bool was_ended = std::exchange(outage.is_end_reported, false);
  const bool is_known =
      std::any_of(outage.reported.begin(), outage.reported.end(),
                  [&fault](const Event& each) { return is_same_fault(each, fault); });
  const bool begins_to_return = is_back && was_ended && !outage.comes_and_goes;
  if (!begins_to_return && (is_known || outage.reported.size() >= faults_of_outage_max))
    return false;
  if (begins_to_return) outage.comes_and_goes = true;
  if (!is_known) outage.reported.push_back(fault);
  fault.comes_and_goes = begins_to_return;
  add(at, std::move(fault));
  return true;
}

double EventJournal::recovery(const Subject& subject, std::chrono::nanoseconds hold, double value) {
  const auto found = outages_.find(subject);
  if (found == outages_.end() || found->second.away_since) return not_a_number;
  Outage& outage = found->second;
  outage.away_since = now_().monotonic;
  if (!std::isnan(value)) outage.newest.value = value;
  outage.hold = hold;
  if (outage.comes_and_goes) outage.hold = std::max<std::chrono::nanoseconds>(hold, returns_within);
  return outage.hold > std::chrono::nanoseconds{} ? not_a_number : end_of(outage).duration_s;
}

Event EventJournal::end_of(Outage& outage) {
  Event event = outage.newest;
  event.kind = EventKind::recovery;
  event.duration_s = seconds(*outage.away_since - outage.since);
  outage.is_end_reported = true;
  add(now_(), event);
  return event;
}

std::vector<Event> EventJournal::settle() {
  std::vector<Event> ended;
  const std::chrono::nanoseconds now = now_().monotonic;
  for (auto next = outages_.begin(); next != outages_.end();) {
    const auto at = next++;
    Outage& outage = at->second;
    if (!outage.away_since) continue;
    const std::chrono::nanoseconds away = now - *outage.away_since;
    if (!outage.is_end_reported && away >= outage.hold) ended.push_back(end_of(outage));
    if (is_over(outage, now)) outages_.erase(at);
  }
  return ended;
}

bool EventJournal::is_over(const Outage& outage, std::chrono::nanoseconds now) {
  return outage.is_end_reported && now - *outage.away_since >= returns_within;
}

const EventJournal::Outage* EventJournal::find(const Subject& subject) const {
  const auto found = outages_.find(subject);
  return found == outages_.end() || found->second.is_end_reported ? nullptr : &found->second;
}

bool EventJournal::lasts(const Subject& subject) const {
  return find(subject) != nullptr;
}

bool EventJournal::comes_and_goes(const Subject& subject) const {
  const Outage* outage = find(subject);
  return outage != nullptr && outage->comes_and_goes;
}

void EventJournal::mode(const std::string& name) {
  if (name == mode_) return;
  const Moment at = now_();
  Event event;
  event.kind = EventKind::mode;
  event.code = name;
  event.subject.name = mode_;
  if (!mode_.empty()) event.duration_s = seconds(at.monotonic - mode_since_);
  mode_ = name;
  mode_since_ = at.monotonic;
  add(at, std::move(event));
}

void EventJournal::command(Event command) {
  command.kind = EventKind::command;
  add(now_(), std::move(command));
}

void EventJournal::daemon(const std::string& code, const std::string& detail) {
  Event event;
  event.code = code;
  event.detail = detail;
  add(now_(), std::move(event));
}

std::vector<Event> EventJournal::ended_within(std::chrono::seconds age,
                                              std::size_t count_max) const {
  const double since_s = seconds(now_().wall - age);
  std::vector<Event> ended;
  for (auto event = events_.rbegin(); event != events_.rend() && ended.size() < count_max; ++event)
    if (event->kind == EventKind::recovery && event->wall_s >= since_s) ended.push_back(*event);
  return ended;
}

}  // namespace thermocomp
