/// The store of a series: a PostgreSQL database with the schema of fleet/schema.
#pragma once

#include <filesystem>
#include <map>
#include <pqxx/connection>
#include <string>
#include <vector>

namespace thermocomp::fleet {

/// `conninfo` with what it leaves out: TLS with a verified name (a Unix socket has none), times
/// after which a server counts as gone, and `more`.
/// @param conninfo  of libpq: "host=... dbname=..." or a URL
/// @throws std::invalid_argument when it cannot be parsed
[[nodiscard]] std::string complete_conninfo(const std::string& conninfo,
                                            std::map<std::string, std::string> more = {});

/// Connects by complete_conninfo(). @throws std::invalid_argument, pqxx::broken_connection
[[nodiscard]] pqxx::connection open_store(const std::string& conninfo);

struct MigrationResult {
  std::vector<std::string> applied;  ///< just now
  std::vector<std::string> present;  ///< before
};
/// Applies the files NNN_*.sql of the folder that the store does not have yet, in order of their
/// names, all in one transaction.
/// @throws std::runtime_error: an applied file is missing or was changed; pqxx::sql_error
MigrationResult migrate(pqxx::connection& store, const std::filesystem::path& folder);

/// Of the build tree or the installed package, beside the folder of the program.
[[nodiscard]] std::filesystem::path schema_folder();

struct NewMachine {
  std::string name;
  std::string type;
  std::string hall;
  bool central_approval{false};
};
/// A row, and a role machine_NAME that may log in with a password made here.
/// @return the password. @throws pqxx::sql_error: the name is there already or no name
[[nodiscard]] std::string add_machine(pqxx::connection& store, const NewMachine& machine);

}  // namespace thermocomp::fleet
