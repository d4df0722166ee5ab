/// What the uplink carries between the store and `thermocomp admit`: an offer one way, the steps
/// that were taken the other. It decides nothing, and needs no right at the daemon's socket.
#pragma once

#include <filesystem>
#include <pqxx/connection>

namespace thermocomp::fleet {

struct ReleaseFiles {
  std::filesystem::path offer;  ///< written
  std::filesystem::path steps;  ///< read; absent: nothing was decided yet
};

/// Once: the newest release of the machine that `store` is connected as, where it is new or an
/// order came; steps that the store does not have.
/// @throws pqxx::failure, cli::Failure, ConfigurationError
void exchange_releases(pqxx::connection& store, const ReleaseFiles& files);

}  // namespace thermocomp::fleet
