#include "status/event.hpp"

#include <array>
#include <cmath>
#include <pwd.h>
#include <utility>

#include "config/text/printable_text.hpp"
#include "estimator/types.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp {

namespace {

struct SubjectName {
  std::string_view name;
  std::string_view before;  ///< precedes the name
  std::string_view after;
};
constexpr std::array<std::string_view, 5> kinds{"fault", "recovery", "mode", "command", "daemon"};
constexpr std::array<SubjectName, 15> subjects{{
    {"nothing", "", ""},
    {"reason", "reason ", ""},
    {"sensor", "sensor ", ""},
    {"suspected_sensor", "suspected sensor ", ""},
    {"input", "input ", ""},
    {"axis", "axis ", ""},
    {"estimate", "estimate of axis ", ""},
    {"bus", "bus ", ""},
    {"bus_errors", "bus ", ", errors"},
    {"device", "device ", ""},
    {"controller", "controller ", ""},
    {"controller_errors", "controller ", ", errors"},
    {"controller_writes", "writes to controller ", ""},
    {"history", "history", ""},
    {"log", "log", ""},
}};

std::string command_text(const Event& event) {
  std::string text = event.code;
  if (!event.subject.name.empty()) text.append(" ").append(event.subject.name);
  if (!std::isnan(event.value)) text.append(" ").append(number_text(event.value)).append(" um");
  if (!event.detail.empty()) text.append(": ").append(event.detail);
  return text;
}

std::string daemon_text(const Event& event) {
  if (event.code == "started") return "started, version " + event.detail;
  return event.detail.empty() ? event.code : event.code + ": " + event.detail;
}

/// Text of a fault, without its subject.
std::string fault_what(const Event& event) {
  switch (event.subject.kind) {
    case SubjectKind::suspected_sensor:
      return "off by " + fixed_signed(event.value, 1) + " K against its neighbours";
    case SubjectKind::input:
      return event.code == "estimated" ? "lost, estimated from the others"
                                       : "lost, and no longer to be estimated";
    case SubjectKind::axis:
      return "mismatch latched: " + event.detail;
    case SubjectKind::estimate:
      return "too uncertain, more than " + fixed(event.value, 2) + " um";
    case SubjectKind::bus_errors:
    case SubjectKind::controller_errors:
      return "error state " + event.code;
    default:
      return event.detail.empty() ? event.code : event.detail;
  }
}

/// The meaning as in the status.
std::string meaning_of(const Event& event) {
  const auto reason = reason_named(event.code);
  if (reason && event.subject.kind == SubjectKind::reason)
    return std::string(code_text(*reason).meaning);
  const auto fault = fault_named(event.code);
  if (fault && event.subject.kind == SubjectKind::sensor)
    return std::string(code_text(*fault).meaning);
  return fault_what(event);
}

std::string fault_text(const Event& event) {
  const std::string of = subject_text(event.subject) + ": ";
  return (event.subject.kind == SubjectKind::reason ? "" : of) + meaning_of(event) +
         (event.comes_and_goes ? ", comes and goes" : "");
}

std::string user_text(const Event& event) {
  if (!(event.user >= 0 && event.user < 4294967295)) return "";
  const passwd* entry = getpwuid(static_cast<uid_t>(event.user));
  return ", by " +
         (entry != nullptr ? std::string(entry->pw_name) : "user " + std::to_string(event.user)) +
         (event.asked_for.empty() ? "" : " for " + event.asked_for);
}

/// Duration, to 0.1 s below a minute for short outages.
std::string lasted(double seconds) {
  return seconds < 60.0 ? fixed(seconds, 1) + " s" : duration_text(seconds);
}

/// A sensor's fault lasts until the value after it is confirmed: " with confirmation, -4.3 K
/// since".
std::string end_text(const Event& event) {
  if (event.subject.kind != SubjectKind::sensor) return {};
  return " with confirmation" +
         (std::isnan(event.value) ? "" : ", " + fixed_signed(event.value, 1) + " K since");
}

std::string text_of_kind(const Event& event) {
  switch (event.kind) {
    case EventKind::fault:
      return fault_text(event);
    case EventKind::recovery:
      return fault_text(event) + ": over, lasted " + lasted(event.duration_s) + end_text(event);
    case EventKind::mode:
      if (event.subject.name.empty()) return event.code;
      return event.subject.name + " -> " + event.code + ", after " + lasted(event.duration_s);
    case EventKind::command:
      return what_text(event) + user_text(event);
    case EventKind::daemon:
      break;
  }
  return what_text(event);
}

}  // namespace

void RecordedMode::take(const Event& event) {
  if (event.kind == EventKind::mode) mode_ = event.code;
  if (event.subject.kind != SubjectKind::axis) return;
  if (event.kind == EventKind::fault && event.code == "mismatch_latched")
    latched_axes_.insert(event.subject.name);
  if (event.kind == EventKind::recovery) latched_axes_.erase(event.subject.name);
}

std::string RecordedMode::name() const {
  const bool is_latched = mode_ == to_string(Mode::compensating) && !latched_axes_.empty();
  return is_latched ? std::string(not_driven) : mode_;
}

std::string_view to_string(EventKind kind) noexcept {
  return kinds.at(static_cast<std::size_t>(kind));
}

std::string_view to_string(SubjectKind kind) noexcept {
  return subjects.at(static_cast<std::size_t>(kind)).name;
}

EventKind event_kind_named(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kinds.size(); ++i)
    if (kinds.at(i) == name) return static_cast<EventKind>(i);
  return EventKind::daemon;
}

SubjectKind subject_kind_named(std::string_view name) noexcept {
  for (std::size_t i = 0; i < subjects.size(); ++i)
    if (subjects.at(i).name == name) return static_cast<SubjectKind>(i);
  return SubjectKind::nothing;
}

std::string subject_text(const Subject& subject) {
  const SubjectName& words = subjects.at(static_cast<std::size_t>(subject.kind));
  return std::string(words.before) + subject.name + std::string(words.after);
}

std::string what_text(const Event& event) {
  switch (event.kind) {
    case EventKind::command:
      return command_text(event);
    case EventKind::daemon:
      return daemon_text(event);
    case EventKind::mode:
      return event.code;
    default:
      return fault_what(event) + (event.comes_and_goes ? ", comes and goes" : "");
  }
}

std::string event_text(const Event& event) {
  return printable_text(text_of_kind(event));
}

std::string events_text(const std::vector<Event>& events) {
  std::string text;
  std::string of_daemon;  // code of the daemon's last own event
  for (const Event& event : events) {
    text += local_time(event.wall_s) + "  " + padded(std::string(to_string(event.kind)), 8) + "  " +
            event_text(event);
    if (event.kind == EventKind::daemon) {
      const std::string before = std::exchange(of_daemon, event.code);
      // A kill or a power cut leaves no event.
      if (of_daemon == "started" && before == "started")
        text += "; the run before was not stopped: killed, or the power failed";
    }
    text += "\n";
  }
  return text.empty() ? "no events\n" : text;
}

}  // namespace thermocomp
