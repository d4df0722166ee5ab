#include "fleet/store/store_commands.hpp"

#include <cstdio>
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
}

}  // namespace thermocomp::fleet
