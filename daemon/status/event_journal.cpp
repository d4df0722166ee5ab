#include "daemon/status/event_journal.hpp"

#include <algorithm>
#include <utility>

namespace thermocomp {
namespace {

double seconds(std::chrono::nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

Event event_of(const char* kind, const std::string& subject, const std::string& what) {
  Event event;
  event.kind = kind;
  event.subject = subject;
  event.what = what;
  return event;
}

}  // namespace

EventJournal::Moment EventJournal::system_now() {
  return {std::chrono::steady_clock::now().time_since_epoch(),
          std::chrono::system_clock::now().time_since_epoch()};
}

void EventJournal::add(const Moment& at, Event event) {
  event.number = ++number_;
  event.wall_ns = at.wall.count();
  if (listener_) listener_(event);
  events_.push_back(std::move(event));
  if (events_.size() > kept_max) events_.pop_front();
}

bool EventJournal::fault(const std::string& subject, const std::string& what) {
  const Moment at = now_();
  const auto known = outages_.find(subject);
  if (known != outages_.end() && is_over(known->second, at.monotonic)) outages_.erase(known);
  Outage& outage = outages_.try_emplace(subject).first->second;
  if (outage.told.empty()) outage.since = at.monotonic;
  outage.what = what;
  const bool is_back = std::exchange(outage.away_since, std::nullopt).has_value();
  const bool was_ended = std::exchange(outage.is_end_told, false);
  const bool is_known =
      std::find(outage.told.begin(), outage.told.end(), what) != outage.told.end();
  if (is_back && was_ended && !outage.comes_and_goes) {
    outage.comes_and_goes = true;
    add(at, event_of("fault", subject, what + ", comes and goes"));
  } else if (!is_known && outage.told.size() < faults_of_outage_max) {
    add(at, event_of("fault", subject, what));
  } else {
    return false;
  }
  if (!is_known) outage.told.push_back(what);
  return true;
}

double EventJournal::recovery(const std::string& subject, std::chrono::nanoseconds hold) {
  const auto found = outages_.find(subject);
  if (found == outages_.end() || found->second.away_since)
    return std::numeric_limits<double>::quiet_NaN();
  Outage& outage = found->second;
  outage.away_since = now_().monotonic;
  outage.hold = hold;
  if (outage.comes_and_goes) outage.hold = std::max<std::chrono::nanoseconds>(hold, returns_within);
  return outage.hold > std::chrono::nanoseconds{} ? std::numeric_limits<double>::quiet_NaN()
                                                  : end_of(subject, outage).duration_s;
}

Event EventJournal::end_of(const std::string& subject, Outage& outage) {
  Event event = event_of("recovery", subject, outage.what);
  event.duration_s = seconds(*outage.away_since - outage.since);
  outage.is_end_told = true;
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
    if (!outage.is_end_told && away >= outage.hold) ended.push_back(end_of(at->first, outage));
    if (is_over(outage, now)) outages_.erase(at);
  }
  return ended;
}

bool EventJournal::is_over(const Outage& outage, std::chrono::nanoseconds now) {
  return outage.is_end_told && now - *outage.away_since >= returns_within;
}

const EventJournal::Outage* EventJournal::find(const std::string& subject) const {
  const auto found = outages_.find(subject);
  return found == outages_.end() || found->second.is_end_told ? nullptr : &found->second;
}

bool EventJournal::lasts(const std::string& subject) const {
  return find(subject) != nullptr;
}

bool EventJournal::comes_and_goes(const std::string& subject) const {
  const Outage* outage = find(subject);
  return outage != nullptr && outage->comes_and_goes;
}

void EventJournal::mode(const std::string& name) {
  if (name == mode_) return;
  const Moment at = now_();
  Event event = event_of("mode", mode_, name);
  if (!mode_.empty()) event.duration_s = seconds(at.monotonic - mode_since_);
  mode_ = name;
  mode_since_ = at.monotonic;
  add(at, std::move(event));
}

void EventJournal::command(const std::string& what, std::int64_t user) {
  Event event = event_of("command", "", what);
  event.user = user;
  add(now_(), std::move(event));
}

void EventJournal::daemon(const std::string& what) {
  add(now_(), event_of("daemon", "", what));
}

std::vector<Event> EventJournal::ended_within(std::chrono::seconds age,
                                              std::size_t count_max) const {
  const std::int64_t since_ns = (now_().wall - std::chrono::nanoseconds(age)).count();
  std::vector<Event> ended;
  for (auto event = events_.rbegin(); event != events_.rend() && ended.size() < count_max; ++event)
    if (event->kind == "recovery" && event->wall_ns >= since_ns) ended.push_back(*event);
  return ended;
}

}  // namespace thermocomp
