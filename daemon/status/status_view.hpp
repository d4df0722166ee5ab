/// Fills the answers of the status socket (status/status.hpp) from reports and health.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon/daemon_config.hpp"
#include "daemon/cycle/cycle.hpp"
#include "daemon/status/status_inputs.hpp"
#include "status/status.hpp"

namespace thermocomp {

[[nodiscard]] Status status_of(const StatusView& view);
[[nodiscard]] SensorsAnswer sensors_of(const StatusView& view);
[[nodiscard]] OffsetsAnswer offsets_of(const StatusView& view);
/// nullopt: no candidate is configured, or it is the model itself.
/// @param contest  nullptr: no candidate runs
[[nodiscard]] std::optional<CandidateStatus> candidate_of(const DaemonConfig& config,
                                                          const ModelContest::Score* contest);
[[nodiscard]] CycleStatus timing_of(const StatusView& view);
/// The answer of `model`: the model file in use.
[[nodiscard]] nlohmann::json model_json(const DaemonConfig& config);
/// One line for systemctl status.
[[nodiscard]] std::string status_line(const StatusView& view);

}  // namespace thermocomp
