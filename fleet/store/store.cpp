#include "fleet/store/store.hpp"

#include <array>
#include <cstdio>
#include <libpq-fe.h>
#include <map>
#include <memory>
#include <pqxx/pqxx>
#include <stdexcept>

#include <sys/random.h>
#include <system_error>

#include "config/model/model_file.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::fleet {
namespace {

std::string quoted(const std::string& value) {
  std::string text(1, '\'');
  for (const char c : value) {
    if (c == '\'' || c == '\\') text += '\\';
    text += c;
  }
  text += '\'';
  return text;
}

/// 32 hexadecimal digits from the kernel's random generator.
std::string random_password() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::system_error(errno, std::generic_category(), "getrandom");
  std::string text;
  for (const unsigned char byte : bytes) {
    std::array<char, 3> digits{};
    std::snprintf(digits.data(), digits.size(), "%02x", static_cast<unsigned>(byte));
    text += digits.data();
  }
  return text;
}

}  // namespace

std::string complete_conninfo(const std::string& conninfo,
                              std::map<std::string, std::string> more) {
  char* problem = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(conninfo.c_str(), &problem), &PQconninfoFree);
  if (!options) {
    const std::string why = problem != nullptr ? problem : "out of memory";
    PQfreemem(problem);
    throw std::invalid_argument(std::string("connection \"").append(conninfo).append("\": ") + why);
  }
  // Timeouts detect a server that vanished. GSS is off, since it takes 0.6 MB of an uplink.
  std::map<std::string, std::string> given{
      {"sslmode", "verify-full"},    {"options", "-c timezone=UTC"}, {"connect_timeout", "10"},
      {"keepalives_idle", "30"},     {"keepalives_interval", "10"},  {"keepalives_count", "3"},
      {"tcp_user_timeout", "60000"}, {"gssencmode", "disable"}};
  given.merge(more);
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option)
    if (option->val != nullptr) given[option->keyword] = option->val;
  std::string text;
  for (const auto& [key, value] : given)
    text.append(key).append("=").append(quoted(value)).append(" ");
  return text;
}

pqxx::connection open_store(const std::string& conninfo) {
  return pqxx::connection(complete_conninfo(conninfo));
}

std::filesystem::path schema_folder() {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
  return program.parent_path().parent_path() / "share/thermocomp/fleet/schema";
}

MigrationResult migrate(pqxx::connection& store, const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;  // name: text
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".sql")
      files[entry.path().filename().string()] = read_text_file(entry.path());
  if (files.empty()) throw std::runtime_error(folder.string() + ": contains no *.sql");
  MigrationResult result;
  pqxx::work work(store);
  work.exec(
      "CREATE TABLE IF NOT EXISTS public.thermocomp_migration (name text PRIMARY KEY,"
      " checksum text NOT NULL, applied timestamptz NOT NULL DEFAULT now());"
      " LOCK TABLE public.thermocomp_migration");
  for (const auto& row : work.exec("SELECT name, checksum FROM public.thermocomp_migration")) {
    const auto name = row[0].as<std::string>();
    const auto file = files.find(name);
    if (file == files.end())
      throw std::runtime_error(
          name +
          ": the store has this migration, which this version does not know: update the program");
    if (sha256_hex(file->second) != row[1].as<std::string>())
      throw std::runtime_error(name + ": was changed after it was applied");
    files.erase(file);
    result.present.push_back(name);
  }
  for (const auto& [name, text] : files) {
    work.exec(text);
    work.exec_params("INSERT INTO public.thermocomp_migration (name, checksum) VALUES ($1, $2)",
                     name, sha256_hex(text));
    result.applied.push_back(name);
  }
  work.commit();
  return result;
}

void add_machine(pqxx::connection& store, const NewMachine& machine,
                 const std::function<void(const std::string& password)>& keep) {
  const std::string password = random_password();
  pqxx::work work(store);
  const auto role = work.exec_params1(
                            "INSERT INTO fleet.machine (name, type, hall, approval)"
                            " VALUES ($1, $2, $3, $4) RETURNING role",
                            machine.name, machine.type, machine.hall,
                            machine.central_approval ? "central" : "machine")[0]
                        .as<std::string>();
  const std::string name = work.quote_name(role);
  work.exec0(std::string("CREATE ROLE ")
                 .append(name)
                 .append(" LOGIN CONNECTION LIMIT 3 IN ROLE fleet_machine PASSWORD '")
                 .append(work.esc(password))
                 .append("'"));
  work.exec0(std::string("ALTER ROLE ").append(name).append(" SET statement_timeout = '60s'"));
  keep(password);
  work.commit();
}

}  // namespace thermocomp::fleet
