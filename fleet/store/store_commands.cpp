#include "fleet/store/store_commands.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <pqxx/pqxx>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <sys/stat.h>

#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"
#include "daemon/history/format/history_time.hpp"
#include "fleet/store/machine_rows.hpp"
#include "fleet/store/store.hpp"
#include "report/files.hpp"

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

/// Creates a file that only the owner can read; fails if it exists.
void write_secret(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0) throw cli::Failure(file.string() + ": " + std::strerror(errno));
  const ssize_t written = ::write(descriptor, text.data(), text.size());
  if (::close(descriptor) != 0 || written != static_cast<ssize_t>(text.size()))
    throw cli::Failure(file.string() + ": could not be written completely");
}

int add(const std::string& conninfo, const NewMachine& machine, const fs::path& file) {
  if (fs::exists(file)) throw cli::Failure(file.string() + ": already exists");
  pqxx::connection store = open_store(conninfo);
  bool is_written = false;
  try {
    add_machine(store, machine, [&](const std::string& password) {
      write_secret(file, password + "\n");
      is_written = true;
    });
  } catch (const pqxx::in_doubt_error&) {
    throw;  // the machine may have been added
  } catch (const std::exception&) {
    if (is_written) fs::remove(file);
    throw;
  }
  std::printf("added %s; its uplink logs in as machine_%s with the password in %s\n",
              machine.name.c_str(), machine.name.c_str(), file.c_str());
  return cli::exit_success;
}

/// A night is computed in the morning after it.
constexpr int night_days_max = 2;

/// "3 min", "2 d"; NULL: "never".
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
  constexpr double day_s = 86400.0;
  if (!row["seen_s"].is_null() && row["newest_s"].is_null())
    text.append(", no rows yet");
  else if (row["newest_s"].as<double>(0.0) > day_s)
    text.append(", newest row ").append(age_text(row["newest_s"]));
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
  if (state == "empty") return text.append(" no probings");
  if (row["departs"].is_null()) return text.append(" no series yet");
  if (row["night_days"].as<int>(0) > night_days_max) text.append(" (old)");
  text.append(row["departs"].as<bool>() ? " DEPARTS" : " like its sisters");
  return text.append(", p ").append(row["probability"].c_str());
}

/// Prints each machine's newest release with its last step, until it is promoted or has ended.
void print_releases(pqxx::read_transaction& work) {
  for (const pqxx::row& row :
       work.exec("SELECT release.id, machine.name, last.step, last.detail, release.note FROM "
                 "fleet.machine"
                 " JOIN fleet.release ON release.id ="
                 "   (SELECT max(id) FROM fleet.release WHERE machine = machine.id)"
                 " CROSS JOIN LATERAL (SELECT step, detail FROM fleet.release_step"
                 "   WHERE release = release.id AND step NOT IN ('approved', 'rollback')"
                 "   ORDER BY id DESC LIMIT 1) last"
                 " WHERE last.step IN ('offered', 'checked', 'candidate') ORDER BY release.id"))
    std::printf("release %s, %s: %s%s%s%s%s\n", row[0].c_str(), row[1].c_str(), row[2].c_str(),
                row[3].size() > 0 ? ", " : "", row[3].c_str(), row[4].size() > 0 ? "; " : "",
                row[4].c_str());
}

/// @return exit status 1: a machine departs, a night failed or is more than two days old, an uplink
///         was not seen for a day, or nothing was recorded in a day
int status(const std::string& conninfo) {
  pqxx::connection store = open_store(conninfo);
  pqxx::read_transaction work(store);
  bool is_well = true;
  std::printf("%-16s %-12s %-12s %-44s %s\n", "machine", "type", "hall", "uplink", "newest night");
  for (const pqxx::row& row :
       work.exec("SELECT *, extract(epoch FROM now() - seen) AS seen_s,"
                 " extract(epoch FROM now() - newest) AS newest_s,"
                 " current_date - night AS night_days FROM fleet.machine_state"
                 " ORDER BY type, hall, name")) {
    std::printf("%-16s %-12s %-12s %-44s %s\n", row["name"].c_str(), row["type"].c_str(),
                row["hall"].c_str(), uplink_text(row).c_str(), night_text(row).c_str());
    constexpr double day_s = 86400.0;
    is_well = is_well && !row["departs"].as<bool>(false) &&
              std::string(row["night_state"].as<std::string>("")) != "failed" &&
              row["seen_s"].as<double>(2 * day_s) < day_s &&
              row["newest_s"].as<double>(2 * day_s) < day_s &&
              row["night_days"].as<int>(0) <= night_days_max;
  }
  print_releases(work);
  return is_well ? cli::exit_success : cli::exit_no;
}

struct LoadOptions {
  std::string machine;
  std::string run;
  std::string begin;
  std::string model;
};

/// True if the column is measured displacement: of an export, neither the offsets of each row nor
/// the values as entered.
bool is_probed(const std::string& column) {
  return is_output(column) && !column.ends_with("_offset_um") && !column.ends_with("_applied_um") &&
         !column.ends_with("_measured_um");
}

/// Means over 10 s of a run file; each measured displacement is a probing.
MeansBatch batch_of(const RunFile& run, std::int64_t begin_ns) {
  MeansBatch batch;
  for (const std::string& column : run.columns)
    if (column != "time_s" && !is_probed(column) && !column.ends_with("_measured_um"))
      batch.columns.push_back(column);
  constexpr double ns_per_s = 1e9;
  std::vector<int> counts;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    const std::int64_t wall_ns = begin_ns + static_cast<std::int64_t>(ns_per_s * run.time_s()[row]);
    const std::int64_t at_s = wall_ns / 1'000'000'000 / mean_s * mean_s;
    if (batch.rows.empty() || batch.rows.back().at_s != at_s) {
      batch.rows.push_back({at_s, std::vector<float>(batch.columns.size(), NAN)});
      counts.assign(batch.columns.size(), 0);
    }
    for (std::size_t i = 0; i < batch.columns.size(); ++i) {
      const auto value = static_cast<float>(run.column(batch.columns[i])[row]);
      float& mean = batch.rows.back().mean[i];
      if (std::isnan(value)) continue;
      mean = counts[i]++ == 0 ? value : mean + (value - mean) / static_cast<float>(counts[i]);
    }
    for (const std::string& column : run.columns) {
      const double value_um = is_probed(column) ? run.column(column)[row] : not_a_number;
      if (std::isnan(value_um)) continue;
      batch.probings.push_back({.output = column,
                                .wall_ns = wall_ns,
                                .measured_um = value_um,
                                .displacement_um = value_um,
                                .source = "probe"});
    }
  }
  return batch;
}

int load(const std::string& conninfo, const LoadOptions& options) {
  const HistoryTime begin = parse_history_time(options.begin);
  if (!begin.wall_ns) throw cli::Failure("--begin " + options.begin + ": must be a date and time");
  MeansBatch batch = batch_of(cli::RunLoader("").load(options.run), *begin.wall_ns);
  if (!options.model.empty()) batch.setup.model_text = read_text_file(options.model);
  batch.program_version = "loaded";
  pqxx::connection store = open_store(conninfo);
  const Taken taken =
      MachineRows(store, options.machine, fs::path(options.run).filename()).send(batch);
  std::printf("%llu rows, %llu refused (time), %llu already present; %zu probed values\n",
              static_cast<unsigned long long>(taken.sent),
              static_cast<unsigned long long>(taken.refused),
              static_cast<unsigned long long>(taken.repeated), batch.probings.size());
  return taken.refused > 0 ? cli::exit_no : cli::exit_success;
}

}  // namespace

void add_store_commands(CLI::App& app, const std::string& store, cli::Action& action) {
  CLI::App* init_command = app.add_subcommand("init",
                                              "creates the tables of a store in an empty "
                                              "database, or updates older tables");
  init_command->callback([&] { action = [&store] { return init(store); }; });

  auto machine = std::make_shared<NewMachine>();
  auto file = std::make_shared<std::string>();
  CLI::App* add_command = app.add_subcommand("add", "adds a machine and the role of its uplink");
  add_command->add_option("MACHINE", machine->name, "name of the machine: letters, digits, _ - .")
      ->required();
  add_command->add_option("--type", machine->type, "type; machines of one type are compared")
      ->type_name("TYPE")
      ->required();
  add_command->add_option("--hall", machine->hall, "location of the machine")->type_name("HALL");
  add_command->add_flag("--central", machine->central_approval,
                        "models are approved by a member of fleet_approval, not at the machine");
  add_command
      ->add_option("-o,--password-file", *file,
                   "file for the role's password, default uplink_MACHINE.password")
      ->type_name("FILE");
  add_command->callback([&store, &action, machine, file] {
    action = [&store, machine, file] {
      if (file->empty()) *file = "uplink_" + machine->name + ".password";
      return add(store, *machine, *file);
    };
  });

  auto loading = std::make_shared<LoadOptions>();
  CLI::App* load_command = app.add_subcommand(
      "load", "loads a run file instead of an uplink, for a machine without network");
  load_command->add_option("MACHINE", loading->machine, "name of the machine in the store")
      ->required();
  load_command->add_option("RUN.csv", loading->run, "run file of thermocomp export")->required();
  load_command
      ->add_option("--begin", loading->begin, "time of its first second: 2026-03-01T08:30:00Z")
      ->required();
  load_command->add_option("--model", loading->model, "the model that was in use")
      ->type_name("FILE");
  load_command->footer("Exit status: 0 success, 1 rows were refused, 2 usage error or bad input.");
  load_command->callback(
      [&store, &action, loading] { action = [&store, loading] { return load(store, *loading); }; });

  CLI::App* status_command = app.add_subcommand("status",
                                                "lists machines with last contact, result of the "
                                                "newest night, and releases in progress");
  status_command->footer(
      "Exit status: 0 no problem; 1 a machine departs, its night failed or is older than two days, "
      "or "
      "its uplink was silent or sent no new row for a day; 2 usage error, or the store is "
      "unreachable.");
  status_command->callback([&] { action = [&store] { return status(store); }; });
}

}  // namespace thermocomp::fleet
