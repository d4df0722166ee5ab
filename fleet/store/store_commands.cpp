#include "fleet/store/store_commands.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <pqxx/pqxx>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <sys/stat.h>

#include "fleet/store/store.hpp"

namespace thermocomp::fleet {
namespace {

namespace fs = std::filesystem;

int init(const std::string& conninfo) {
  pqxx::connection store = open_store(conninfo);
  const MigrationResult result = migrate(store, schema_folder());
  for (const std::string& name : result.applied) std::printf("applied %s\n", name.c_str());
  pqxx::work work(store);
  work.exec1("SELECT fleet.make_partitions()");
  work.commit();
  std::printf("the store is ready, %zu migrations\n",
              result.applied.size() + result.present.size());
  return cli::exit_success;
}

/// A file that nobody else may read, and that was not there before.
void write_secret(const fs::path& file, const std::string& text) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0) throw cli::Failure(file.string() + ": " + std::strerror(errno));
  const ssize_t written = write(descriptor, text.data(), text.size());
  if (close(descriptor) != 0 || written != static_cast<ssize_t>(text.size()))
    throw cli::Failure(file.string() + ": could not be written whole");
}

int add(const std::string& conninfo, const NewMachine& machine, const fs::path& file) {
  if (fs::exists(file)) throw cli::Failure(file.string() + ": exists already");
  pqxx::connection store = open_store(conninfo);
  const std::string password = add_machine(store, machine);
  write_secret(file, password + "\n");
  std::printf("added %s; its uplink logs in as machine_%s with the password in %s\n",
              machine.name.c_str(), machine.name.c_str(), file.c_str());
  return cli::exit_success;
}

/// "3 min", "2 d"; of a NULL "never".
std::string age_text(const pqxx::field& age_s) {
  if (age_s.is_null()) return "never";
  const double seconds = std::max(0.0, age_s.as<double>());
  std::array<char, 32> text{};
  const auto print = [&](double value, const char* unit) {
    std::snprintf(text.data(), text.size(), "%.0f %s ago", value, unit);
  };
  constexpr double min_s = 60.0, hour_s = 3600.0, day_s = 86400.0;
  if (seconds < 2 * hour_s)
    print(seconds / min_s, "min");
  else if (seconds < 2 * day_s)
    print(seconds / hour_s, "h");
  else
    print(seconds / day_s, "d");
  return text.data();
}

std::string uplink_text(const pqxx::row& row) {
  std::string text = age_text(row["seen_s"]);
  const auto count = [&](const char* column, const char* what) {
    const auto number = row[column].as<std::uint64_t>(0);
    if (number > 0) text.append(", ").append(std::to_string(number)).append(" ").append(what);
  };
  count("sent", "rows");
  count("refused", "refused (clock)");
  count("repeated", "repeated");
  count("damaged", "damaged parts");
  return text;
}

std::string night_text(const pqxx::row& row) {
  if (row["night"].is_null()) return "no night yet";
  std::string text(row["night"].c_str());
  const std::string state = row["night_state"].c_str();
  if (state == "failed") return text.append(" failed: ").append(row["error"].c_str());
  if (state == "empty") return text.append(" nothing was probed");
  if (row["departs"].is_null()) return text.append(" no series yet");
  text.append(row["departs"].as<bool>() ? " DEPARTS" : " like its sisters");
  return text.append(", p ").append(row["probability"].c_str());
}

/// Exit status 1: a machine departs, a night failed, or an uplink was not seen for a day.
int status(const std::string& conninfo) {
  pqxx::connection store = open_store(conninfo);
  pqxx::read_transaction work(store);
  bool is_well = true;
  std::printf("%-16s %-12s %-12s %-44s %s\n", "machine", "type", "hall", "uplink", "newest night");
  for (const pqxx::row& row :
       work.exec("SELECT *, extract(epoch FROM now() - seen) AS seen_s FROM fleet.machine_state"
                 " ORDER BY type, hall, name")) {
    std::printf("%-16s %-12s %-12s %-44s %s\n", row["name"].c_str(), row["type"].c_str(),
                row["hall"].c_str(), uplink_text(row).c_str(), night_text(row).c_str());
    constexpr double day_s = 86400.0;
    is_well = is_well && !row["departs"].as<bool>(false) &&
              std::string(row["night_state"].as<std::string>("")) != "failed" &&
              row["seen_s"].as<double>(2 * day_s) < day_s;
  }
  return is_well ? cli::exit_success : cli::exit_no;
}

}  // namespace

void add_store_commands(CLI::App& app, const std::string& store, cli::Action& action) {
  CLI::App* init_command = app.add_subcommand("init",
                                              "makes the tables of a new store in an empty "
                                              "database, or brings older ones up to this version");
  init_command->callback([&] { action = [&store] { return init(store); }; });

  auto machine = std::make_shared<NewMachine>();
  auto file = std::make_shared<std::string>();
  CLI::App* add_command =
      app.add_subcommand("add", "adds a machine, and the role by which its uplink logs in");
  add_command->add_option("MACHINE", machine->name, "its name: letters, digits, _ - .")->required();
  add_command->add_option("--type", machine->type, "machines of one type are compared")
      ->type_name("TYPE")
      ->required();
  add_command->add_option("--hall", machine->hall, "where it stands")->type_name("HALL");
  add_command->add_flag("--central", machine->central_approval,
                        "models are approved by a member of fleet_approval, not at the machine");
  add_command
      ->add_option("-o,--password-file", *file,
                   "where the role's password is written, for the uplink (uplink_MACHINE.password)")
      ->type_name("FILE");
  add_command->callback([&store, &action, machine, file] {
    action = [&store, machine, file] {
      if (file->empty()) *file = "uplink_" + machine->name + ".password";
      return add(store, *machine, *file);
    };
  });

  CLI::App* status_command = app.add_subcommand(
      "status", "the machines: when they were heard last, and what their newest night found");
  status_command->footer(
      "Exit status: 0 all is well; 1 a machine departs, a night failed, or an uplink was not heard "
      "for "
      "a day; 2 bad use, or the store is not reached.");
  status_command->callback([&] { action = [&store] { return status(store); }; });
}

}  // namespace thermocomp::fleet
