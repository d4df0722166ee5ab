/// Any answer of the daemon, as used by command and gateway: it is refused with a message, or all
/// views can be made from it with distinct names.
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/observe/status_text.hpp"
#include "cli/observe/watch_text.hpp"
#include "common/fuzz.hpp"
#include "config/text/outer_json.hpp"
#include "gateway/feed/page_state.hpp"
#include "gateway/texts/metrics_text.hpp"
#include "gateway/texts/mqtt_texts.hpp"
#include "gateway/texts/shdr_text.hpp"
#include "status/status.hpp"
#include "status/verdict.hpp"

using namespace thermocomp;
using namespace thermocomp::gateway;
using nlohmann::json;

namespace {

/// Copied and printed like the callers do: unbounded depth ends the process here.
json taken(std::string_view line) {
  const json message = parse_outer_json(line);
  const json copy = message;
  FUZZ_REQUIRE(!copy.dump(-1, ' ', false, json::error_handler_t::replace).empty());
  return copy;
}

void look_at(const Status& status, const SensorsAnswer& sensors) {
  static_cast<void>(cli::status_text(status, true));
  static_cast<void>(cli::sensors_text(sensors, true));
  static_cast<void>(cli::watch_screen(status, nullptr, true));
  static_cast<void>(why_not(status, true));
  static_cast<void>(troubles(status, &sensors));
}

template <class Part>
std::set<std::string> names_of(const std::vector<Part>& parts) {
  std::set<std::string> names;
  for (const Part& part : parts) names.insert(part.name);
  return names;
}

void check_gateway(const Status& status, const SensorsAnswer& sensors_answer,
                   const EventsAnswer& events) {
  gateway::Snapshot snapshot;
  snapshot.is_here = true;
  snapshot.status = status;
  snapshot.sensors = sensors_answer;
  snapshot.events = std::make_shared<const std::vector<Event>>(events.events);
  static_cast<void>(page_state(snapshot, "mill"));
  static_cast<void>(page_events(snapshot, 12));
  static_cast<void>(metrics_text(snapshot, {}));

  const ShdrStates states = shdr_states(snapshot);
  std::size_t sensors = 0;
  for (const auto& [item, entries] : states) {
    FUZZ_REQUIRE(!entries.empty());
    sensors += item.starts_with("temp_") ? 1u : 0u;
    for (const char c : item) FUZZ_REQUIRE(c == '_' || std::isalnum(static_cast<unsigned char>(c)));
  }
  FUZZ_REQUIRE(sensors == names_of(sensors_answer.sensors).size());
  for (const char c : shdr_lines({}, states, 0.0))
    FUZZ_REQUIRE(c == '\n' || static_cast<unsigned char>(c) >= ' ');

  std::set<std::string> topics;
  for (const TopicState& state : topic_states(snapshot, "mill")) {
    FUZZ_REQUIRE(state.topic.find_first_of("+# \n") == std::string::npos);
    topics.insert(state.topic);
  }
  FUZZ_REQUIRE(topics.size() ==
               1 + names_of(sensors_answer.sensors).size() + names_of(status.axes).size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const json answer = taken({reinterpret_cast<const char*>(data), size});
    const Status status = part_from<Status>(answer);
    const SensorsAnswer sensors = part_from<SensorsAnswer>(answer);
    look_at(status, sensors);
    check_gateway(status, sensors, part_from<EventsAnswer>(answer));
  } catch (const JsonError& error) {
    FUZZ_REQUIRE(*error.what() != '\0');
  }
  return 0;
}
