/// Exchange of releases between the store and `thermocomp admit`: offers in one direction, steps in
/// the other. Makes no decisions and needs no access to the daemon's socket.
#pragma once

#include <filesystem>
#include <pqxx/connection>

namespace thermocomp::fleet {

struct ReleaseFiles {
  std::filesystem::path offer;  ///< written
  std::filesystem::path steps;  ///< read; absent: no decision yet
};

/// One exchange: the newest release of the machine that `store` is logged in as, if it is new or
/// has a new order, and steps that the store lacks.
/// @throws pqxx::failure, cli::Failure, ConfigurationError
void exchange_releases(pqxx::connection& store, const ReleaseFiles& files);

}  // namespace thermocomp::fleet
