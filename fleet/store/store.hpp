/// Store of a series: a PostgreSQL database with the schema of fleet/schema.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <pqxx/connection>
#include <string>
#include <vector>

namespace thermocomp::fleet {

/// Adds defaults to `conninfo`: verified TLS (not for a Unix socket), timeouts, and `more`.
/// @param conninfo  of libpq: "host=... dbname=..." or a URL
/// @throws std::invalid_argument if it cannot be parsed
[[nodiscard]] std::string complete_conninfo(const std::string& conninfo,
                                            std::map<std::string, std::string> more = {});

/// Connects by complete_conninfo(). @throws std::invalid_argument, pqxx::broken_connection
[[nodiscard]] pqxx::connection open_store(const std::string& conninfo);

struct MigrationResult {
  std::vector<std::string> applied;  ///< by this call
  std::vector<std::string> present;  ///< earlier
};
/// Applies the folder's files NNN_*.sql that the store lacks, by name, in one transaction.
/// @throws std::runtime_error: an applied file is missing or was changed; pqxx::sql_error
MigrationResult migrate(pqxx::connection& store, const std::filesystem::path& folder);

/// Schema of the build tree or the installed package, beside the program's folder.
[[nodiscard]] std::filesystem::path schema_folder();

struct NewMachine {
  std::string name;
  std::string type;
  std::string hall;
  bool central_approval{false};
};
/// Adds a row, and a role machine_NAME with a generated password.
/// @param keep  keeps the password; if it throws, nothing is added
/// @throws pqxx::sql_error: the name exists or is invalid
void add_machine(pqxx::connection& store, const NewMachine& machine,
                 const std::function<void(const std::string& password)>& keep);

}  // namespace thermocomp::fleet
