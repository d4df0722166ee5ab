#include "gateway/api/history_answer.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/history/replay/thinned_history.hpp"
#include "estimator/types.hpp"
#include "gateway/feed/page_state.hpp"
#include "status/event.hpp"

namespace thermocomp::gateway {

namespace {

using nlohmann::json;

JsonAnswer error_answer(unsigned status, const std::string& text) {
  return {status, error_text(text)};
}

/// Seven digits: more than a chart shows, and half the size of all digits.
void append_short(std::string& text, double value) {
  if (!std::isfinite(value)) {
    text += "null";
    return;
  }
  constexpr int digits = 7;
  std::array<char, 40> chars{};
  const auto [end, code] = std::to_chars(chars.data(), chars.data() + chars.size(), value,
                                         std::chars_format::general, digits);
  text.append(chars.data(), code == std::errc() ? end : chars.data());
}

void append_column(std::string& text, const std::string& name, const std::vector<double>& values) {
  if (text.back() != '{') text += ',';
  text += dumped(name) + ":[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += ',';
    append_short(text, values[i]);
  }
  text += ']';
}

json number(double value) {
  return std::isfinite(value) ? json(value) : json();
}

json probings_json(const std::vector<Probing>& probings) {
  json list = json::array();
  for (const Probing& probing : probings)
    list.push_back({{"axis", probing.axis},
                    {"time_s", probing.time_s},
                    {"left_um", number(probing.left_um)},
                    {"needed_um", number(probing.needed_um)}});
  return list;
}

/// Intervals without compensation: the mode, "not_driven" or "no_daemon".
json modes_json(const std::vector<RecordedEvent>& events, const HistoryRequest& request) {
  json list = json::array();
  std::string mode;  // empty: unknown or none
  double since_s = 0.0;
  const auto go_on = [&](double wall_s, std::string next) {
    if (mode == next) return;
    if (!mode.empty() && mode != to_string(Mode::compensating) && wall_s > request.from_s)
      list.push_back({{"mode", mode}, {"from_s", since_s}, {"to_s", wall_s}});
    mode = std::move(next);
    since_s = wall_s;
  };
  RecordedMode recorded;
  for (const RecordedEvent& event : events) {
    if (event.kind == EventKind::daemon && event.code != "history") {
      // If the end of a run is unknown, so is the duration of its last mode.
      if (event.code == "started" && std::isfinite(event.duration_s))
        go_on(event.wall_s - event.duration_s, event.duration_s > 0.0 ? "no_daemon" : "");
      else if (event.code == "started")
        mode.clear();
      go_on(event.wall_s, "");
      recorded = {};
      continue;
    }
    recorded.take(event);
    go_on(event.wall_s, recorded.name());
  }
  go_on(request.to_s, "");
  return list;
}

/// Chart marks: starts, commands, faults of modules and links; not their effects.
json events_json(const std::vector<RecordedEvent>& events, const HistoryRequest& request) {
  constexpr std::size_t most = 200;
  json list = json::array();
  for (auto event = events.rbegin(); event != events.rend() && list.size() < most; ++event) {
    const bool is_link = event->subject.kind == SubjectKind::bus ||
                         event->subject.kind == SubjectKind::device ||
                         event->subject.kind == SubjectKind::controller;
    const bool counts = event->kind == EventKind::command || event->kind == EventKind::daemon ||
                        (event->kind == EventKind::fault && is_link);
    if (counts && event->wall_s >= request.from_s)
      list.push_back({{"time_s", event->wall_s}, {"text", page_event_text(*event)}});
  }
  return list;
}

}  // namespace

JsonAnswer history_answer(const DaemonFeed& feed, const HistoryRequest& request) {
  const std::filesystem::path file = feed.history_file();
  if (file.empty()) return error_answer(503, "the location of the history is unknown");
  try {
    const ThinnedHistory history = thin_history(file, request.from_s, request.to_s, request.points);
    const double span_s = (request.to_s - history.from_s) / static_cast<double>(request.points);
    json damage = json::array();
    for (const HistoryDamage& part : history.damage) damage.push_back(to_string(part));
    std::string text = R"({"columns":{)";
    text += "\"time_s\":" + dumped(history.time_s);
    for (const ThinnedColumn& column : history.columns)
      append_column(text, column.name, column.values);
    json rest = {{"from_s", history.from_s},
                 {"recorded_since_s", number(history.begins_s)},
                 {"to_s", request.to_s},
                 {"span_s", span_s},
                 {"probings", probings_json(history.probings)},
                 {"modes", modes_json(history.events, request)},
                 {"events", events_json(history.events, request)},
                 {"chunks", history.chunks},
                 {"chunks_read", history.chunks_read},
                 {"damage", std::move(damage)}};
    text += "}," + dumped(rest).substr(1);
    return {200, std::move(text)};
  } catch (const std::exception& error) {
    return error_answer(503, error.what());
  }
}

}  // namespace thermocomp::gateway
