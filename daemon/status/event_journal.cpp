#include "daemon/status/event_journal.hpp"

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

void EventJournal::fault(const std::string& subject, const std::string& what) {
  const Moment at = now_();
  const auto [outage, is_new] = outages_.try_emplace(subject, Outage{at.monotonic, what});
  if (!is_new && outage->second.what == what) return;
  outage->second.what = what;
  add(at, event_of("fault", subject, what));
}

void EventJournal::recovery(const std::string& subject, std::chrono::nanoseconds ago) {
  const auto outage = outages_.find(subject);
  if (outage == outages_.end()) return;
  const Moment at = now_();
  Event event = event_of("recovery", subject, outage->second.what);
  event.duration_s = seconds(at.monotonic - ago - outage->second.since);
  outages_.erase(outage);
  add(at, std::move(event));
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
