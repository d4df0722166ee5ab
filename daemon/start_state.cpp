#include "daemon/start_state.hpp"

#include <cmath>
#include <fmt/format.h>

#include <system_error>

#include "daemon/controller_lock.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "daemon/state/state_file.hpp"
#include "estimator/sensing/sensor.hpp"

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
    // The reader skipped a damaged segment that may be newer; 0: the whole file.
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
    return found;  // left by a daemon that stopped before its first commit
  try {
    search(HistoryReader(history), parser, found);
  } catch (const std::exception& problem) {
    // The file exists but cannot be read as a history.
    found.has_run = true;
    found.is_newest = false;
    found.problem = problem.what();
  }
  return found;
}

namespace {

RecordedState recorded_state(const HistoryConfig& history) {
  return history.enabled ? last_recorded_state(history.file) : RecordedState{};
}

void take_recorded(const RecordedState& recorded, const std::string& why, StartState& start) {
  start.state = *recorded.state;
  if (recorded.is_newest) {
    start.warnings.push_back(why +
                             "; reference, switch and corrections are taken from the history");
    return;
  }
  start.state.enabled = false;
  start.warnings.push_back(why +
                           "; reference and corrections are taken from the history, of which"
                           " the newest part is damaged (" +
                           recorded.problem +
                           "); compensation stays off until `thermocomp enable`");
}

/// Discards references that this machine's sensors cannot have measured.
void refuse_impossible(const DaemonConfig& config, StartState& start) {
  const std::vector<std::string> refused = impossible_references(
      config.estimator, config.model.temperature_columns(), start.state.reference_degC);
  if (refused.empty()) return;
  for (const std::string& each : refused)
    start.warnings.push_back("state file " + config.state_file.string() + ": " + each +
                             "; the reference is lost and the compensation off");
  start.state.reference_degC.clear();
  start.reference = {};
  start.state.enabled = false;
  start.reference_lost = true;
  start.is_on_disk = false;
}

/// Removes offsets that this configuration cannot have sent.
void refuse_beyond_bound(const DaemonConfig& config, const std::string& source, Offsets& offset_um,
                         std::vector<std::string>& warnings) {
  for (const AxisConfig& axis : config.estimator.axes) {
    const auto found = offset_um.find(axis.name);
    const double bound_um = axis.limiter.offset_um_max;
    // Negated: NaN is removed too.
    if (found == offset_um.end() || std::abs(found->second) <= bound_um) continue;
    warnings.push_back(
        fmt::format("{}: offset_um.{} = {:g} is beyond this configuration's "
                    "offset_um_max = {:g} and is not taken",
                    source, axis.name, found->second, bound_um));
    offset_um.erase(found);
  }
}

void refuse_impossible_offsets(const DaemonConfig& config, StartState& start) {
  PersistentState& state = start.state;
  const std::string file = "state file " + config.state_file.string();
  refuse_beyond_bound(config, file, state.offset_um, start.warnings);
  refuse_beyond_bound(config, "last-sent record", state.recorded_um, start.warnings);
  for (const AxisConfig& axis : config.estimator.axes) {
    const auto sign = state.sign.find(axis.name);
    const bool same = state.controller == controller_identity(config.controller) &&
                      sign != state.sign.end() && sign->second == axis.sign;
    if (same || state.corridor_um.erase(axis.name) == 0) continue;
    start.warnings.push_back(file + ": the offset of axis " + axis.name +
                             " was sent to another controller or with another sign, and is not "
                             "used as the last offset sent");
  }
}

StartState find(const DaemonConfig& config) {
  StartState start;
  PersistentState first;
  first.enabled = config.estimator.compensation.enabled_at_first_start;
  const LoadedState loaded = load_state_file(config.state_file, first);
  start.state = loaded.state;
  start.reference_lost = loaded.reference_lost;
  start.reference = loaded.reference;
  if (loaded.found) return start;
  const RecordedState recorded = recorded_state(config.history);
  if (!loaded.damaged && !recorded.has_run) return start;  // the first start
  const std::string why =
      loaded.damaged ? loaded.warning
                     : "state file " + config.state_file.string() +
                           " is missing, but according to the history this is not the first start";
  start.is_on_disk = false;
  if (recorded.state) {
    take_recorded(recorded, why, start);
    return start;
  }
  start.state.enabled = false;
  start.reference_lost = true;
  const std::string problem = recorded.problem.empty() ? "" : " (" + recorded.problem + ")";
  start.warnings.push_back(why + "; the history has no sound segment to go by" + problem);
  return start;
}

}  // namespace

StartState find_start_state(const DaemonConfig& config, Offsets recorded) {
  StartState start = find(config);
  refuse_impossible(config, start);
  // The record is newer than the saved corridor.
  for (const auto& [axis, offset_um] : recorded)
    if (std::isnan(offset_um)) start.state.corridor_um.erase(axis);
  std::erase_if(recorded, [](const auto& each) { return std::isnan(each.second); });
  start.state.recorded_um = std::move(recorded);
  refuse_impossible_offsets(config, start);
  return start;
}

}  // namespace thermocomp
