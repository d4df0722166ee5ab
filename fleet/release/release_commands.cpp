#include "fleet/release/release_commands.hpp"

#include <cstdint>
#include <cstdio>
#include <memory>
#include <pqxx/pqxx>

#include <CLI/CLI.hpp>

#include "config/model/approval.hpp"
#include "config/model/model_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "fleet/store/store.hpp"

namespace thermocomp::fleet {
namespace {

struct OfferOptions {
  std::string whom;
  std::string model;
  std::string note;
};

/// Offers a model to one machine or to all of a type.
int offer(const std::string& conninfo, const OfferOptions& options) {
  const std::string text = read_text_file(options.model, model_bytes_max);
  static_cast<void>(parse_model(text, options.model));  // refuses an incomplete file
  pqxx::connection store = open_store(conninfo);
  pqxx::work work(store);
  work.exec_params0(
      "INSERT INTO fleet.document (checksum, kind, content) VALUES ($1, 'model', $2)"
      " ON CONFLICT DO NOTHING",
      sha256_hex(text), text);
  const pqxx::result machines = work.exec_params(
      "SELECT id, name FROM fleet.machine WHERE name = $1 OR (type = $1 AND NOT EXISTS"
      " (SELECT FROM fleet.machine WHERE name = $1)) ORDER BY name",
      options.whom);
  if (machines.empty()) throw cli::Failure(options.whom + ": no machine or type has this name");
  for (const auto& machine : machines) {
    const auto release =
        work.exec_params1(
                "INSERT INTO fleet.release (machine, model, note) VALUES ($1, $2, $3) RETURNING id",
                machine[0].as<int>(), sha256_hex(text), options.note)[0]
            .as<std::uint64_t>();
    work.exec_params0("INSERT INTO fleet.release_step (release, step) VALUES ($1, 'offered')",
                      release);
    std::printf("release %ju: offered to %s\n", static_cast<std::uintmax_t>(release),
                machine[1].c_str());
  }
  work.commit();
  return cli::exit_success;
}

struct OrderOptions {
  std::uint64_t release{0};
  std::string key;
  bool takes_back{false};
};

/// The machine's last step with this release, or its withdrawal; empty: none.
std::string done_with(pqxx::work& work, std::uint64_t release) {
  const pqxx::result steps = work.exec_params(
      "SELECT step FROM fleet.release_step WHERE release = $1 AND step IN ('checked', 'refused',"
      " 'candidate', 'promoted', 'rolled_back', 'withdrawn') ORDER BY id DESC LIMIT 1",
      release);
  return steps.empty() ? "" : steps[0][0].as<std::string>();
}

void add_step(pqxx::work& work, std::uint64_t release, const char* step,
              const std::string& detail) {
  work.exec_params0("INSERT INTO fleet.release_step (release, step, detail) VALUES ($1, $2, $3)",
                    release, step, detail);
}

int order(const std::string& conninfo, const OrderOptions& options) {
  pqxx::connection store = open_store(conninfo);
  pqxx::work work(store);
  const pqxx::result found = work.exec_params(
      "SELECT machine.name, release.model, machine.approval FROM fleet.release"
      " JOIN fleet.machine ON machine.id = release.machine WHERE release.id = $1",
      options.release);
  const std::string name = "release " + std::to_string(options.release);
  if (found.empty()) throw cli::Failure(name + ": does not exist");
  const auto machine = found[0][0].as<std::string>();
  const std::string done = done_with(work, options.release);
  if (done == "refused" || done == "rolled_back" || done == "withdrawn")
    throw cli::Failure(name + ": " + machine + " has finished it (" + done + "): offer another",
                       cli::exit_no);
  if (options.takes_back && done != "promoted") {
    add_step(work, options.release, "withdrawn", "");
    work.commit();
    std::printf("%s: withdrawn from %s\n", name.c_str(), machine.c_str());
    return cli::exit_success;
  }
  if (found[0][2].as<std::string>() != "central")
    throw cli::Failure(name + ": " + machine + " is approved at the machine: thermocomp promote " +
                           (options.takes_back ? "--back there" : "there"),
                       cli::exit_no);
  if (options.key.empty()) throw cli::Failure("--key: the order must be signed");
  const std::string signature = sign_order(
      {machine, options.release, found[0][1].as<std::string>(), options.takes_back}, options.key);
  add_step(work, options.release, options.takes_back ? "rollback" : "approved", signature);
  work.commit();
  std::printf("%s: %s for %s\n", name.c_str(), options.takes_back ? "taken back" : "approved",
              machine.c_str());
  return cli::exit_success;
}

void add_order(CLI::App& app, const std::string& store, cli::Action& action, const char* name,
               const char* help, bool takes_back) {
  auto options = std::make_shared<OrderOptions>();
  options->takes_back = takes_back;
  CLI::App* command = app.add_subcommand(name, help);
  command->add_option("RELEASE", options->release, "number of the release")->required();
  command->add_option("--key", options->key, "private Ed25519 key that signs the order, PEM")
      ->type_name("FILE");
  command->callback([&store, &action, options] {
    action = [&store, options] { return order(store, *options); };
  });
}

}  // namespace

void add_release_commands(CLI::App& app, const std::string& store, cli::Action& action) {
  auto options = std::make_shared<OfferOptions>();
  CLI::App* command = app.add_subcommand(
      "offer", "offers a model to a machine or to all machines of a type; each machine checks it");
  command->add_option("WHOM", options->whom, "machine or type")->required();
  command->add_option("MODEL", options->model, "model file")->type_name("FILE")->required();
  command->add_option("--note", options->note, "reason, shown to those who approve it")
      ->type_name("TEXT");
  command->callback([&store, &action, options] {
    action = [&store, options] { return offer(store, *options); };
  });
  add_order(app, store, action, "approve",
            "approves a release by signature, for machines with central approval", false);
  add_order(app, store, action, "rollback",
            "takes a release back: withdraws it if it is not in use yet, else approves the "
            "previous model by signature",
            true);
}

}  // namespace thermocomp::fleet
