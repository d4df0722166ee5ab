#include "daemon/history/replay/last_state.hpp"

#include <system_error>

#include "daemon/history/replay/segment_steps.hpp"

namespace thermocomp {
namespace {

PersistentState state_after(const HistoryReader& reader, const SegmentInfo& segment,
                            const SetupParser& parser) {
  const ReplaySetup setup = parser(reader.setup(segment));
  SegmentSteps steps(reader, segment, setup);
  while (steps.step()) {
  }
  Report report = steps.estimator().make_report();
  steps.estimator().report(report);
  PersistentState state = steps.estimator().persistent_state(report);
  if (setup.dry_run) state.offset_um.clear();  // they were not sent
  return state;
}

void search(const HistoryReader& reader, const SetupParser& parser, RecordedState& found) {
  const std::vector<SegmentInfo>& segments = reader.segments();
  found.has_run = !segments.empty() || !reader.damage().empty();
  for (const HistoryDamage& damage : reader.damage()) {
    // What the reader left out and may be of a later time than all it took; 0: the whole file.
    if (!segments.empty() && damage.segment != 0 && damage.segment <= segments.back().id) continue;
    found.is_newest = false;
    found.problem = to_string(damage);
  }
  for (auto segment = segments.rbegin(); segment != segments.rend() && !found.state; ++segment) {
    try {
      found.state = state_after(reader, *segment, parser);
    } catch (const std::exception& error) {
      if (found.is_newest)
        found.problem = "segment " + std::to_string(segment->id) + ": " + error.what();
      found.is_newest = false;
    }
  }
}

}  // namespace

RecordedState last_recorded_state(const std::filesystem::path& history, const SetupParser& parser) {
  RecordedState found;
  std::error_code error;
  const auto status = std::filesystem::status(history, error);
  if (status.type() == std::filesystem::file_type::not_found) return found;
  if (status.type() == std::filesystem::file_type::regular &&
      std::filesystem::file_size(history, error) == 0 && !error)
    return found;  // as a daemon leaves it that was stopped before its first commit
  try {
    search(HistoryReader(history), parser, found);
  } catch (const std::exception& problem) {
    // Something is there that once was a history.
    found.has_run = true;
    found.is_newest = false;
    found.problem = problem.what();
  }
  return found;
}

}  // namespace thermocomp
