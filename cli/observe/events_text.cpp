#include "cli/observe/events_text.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <pwd.h>
#include <utility>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;

std::string user_text(const json& event) {
  const double user = number_of(event, "user");
  if (!(user >= 0.0 && user < 4294967295.0)) return "";
  const auto id = static_cast<uid_t>(user);
  const passwd* entry = getpwuid(id);
  return ", by " + (entry != nullptr ? std::string(entry->pw_name) : "user " + std::to_string(id));
}

/// Below a minute with a tenth: short outages are what events are read for.
std::string lasted(double seconds) {
  return seconds < 60.0 ? fixed(seconds, 1) + " s" : duration_text(seconds);
}

/// What is wrong, in the words of the status.
std::string fault_words(const std::string& subject, const std::string& what) {
  if (subject.starts_with("reason ")) return std::string(reason_text(what).meaning);
  if (subject.starts_with("sensor ")) return subject + ": " + std::string(fault_text(what).meaning);
  return subject + ": " + what;
}

}  // namespace

std::string local_time(double wall_s) {
  if (!(wall_s >= 0.0 && wall_s < 1e11)) return "-";
  const auto seconds = static_cast<std::time_t>(wall_s);
  std::tm parts{};
  localtime_r(&seconds, &parts);
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &parts);
  const auto tenths = static_cast<int>(10.0 * (wall_s - std::floor(wall_s)));
  return std::string(text.data()) + "." + std::to_string(tenths);
}

std::string event_text(const json& event) {
  const std::string kind = text_of(event, "kind");
  const std::string subject = text_of(event, "subject");
  const std::string what = text_of(event, "what");
  const double duration_s = number_of(event, "duration_s");
  std::string text = what;
  if (kind == "fault") text = fault_words(subject, what);
  if (kind == "recovery")
    text = fault_words(subject, what) + ": over, lasted " + lasted(duration_s);
  if (kind == "mode" && !subject.empty())
    text = subject + " -> " + what + ", after " + lasted(duration_s);
  if (kind == "command") text += user_text(event);
  return printable_text(text);
}

std::string events_text(const json& events) {
  std::string text;
  std::string of_daemon;  // the last of its own events
  for (const json& event : list_of(events, "events")) {
    const std::string kind = text_of(event, "kind");
    text +=
        local_time(number_of(event, "wall_s")) + "  " + padded(kind, 8) + "  " + event_text(event);
    if (kind == "daemon") {
      const std::string before = std::exchange(of_daemon, text_of(event, "what"));
      // Nobody is there to write down a kill or a power cut.
      if (of_daemon.starts_with("started") && before.starts_with("started"))
        text += "; the run before was not stopped: killed, or the power failed";
    }
    text += "\n";
  }
  return text.empty() ? "nothing has happened\n" : text;
}

}  // namespace thermocomp::cli
