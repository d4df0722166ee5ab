#include "daemon/start_state.hpp"

#include "daemon/history/replay/last_state.hpp"
#include "daemon/state/state_file.hpp"
#include "estimator/temperature_range.hpp"

namespace thermocomp {
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

/// A reference that cannot have been taken at the machine is none.
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
                           " is missing, but the history says that this is not the first start";
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

StartState find_start_state(const DaemonConfig& config) {
  StartState start = find(config);
  refuse_impossible(config, start);
  return start;
}

}  // namespace thermocomp
