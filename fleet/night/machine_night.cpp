#include "fleet/night/machine_night.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <map>
#include <optional>
#include <pqxx/pqxx>
#include <spawn.h>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <system_error>

#include "config/text/printable_text.hpp"
#include "config/toml/toml_reader.hpp"

extern char** environ;

namespace thermocomp::fleet {
namespace {

namespace fs = std::filesystem;

constexpr int probings_min = 8;              ///< required per night
constexpr std::size_t nights_of_series = 7;  ///< of each machine, before the night under test
constexpr double probability_least = 1e-30;  ///< close to the smallest PostgreSQL real
constexpr int machines_min = 3;              ///< besides the one under test
constexpr std::size_t sisters_max = 3 + 60;  ///< arguments of the command; more hardly improve S

/// True unless the column is an offset, sent or applied: not an input of a machine's displacement.
bool is_column_of_run(const std::string& name) {
  return !name.ends_with("_offset_um") && !name.ends_with("_applied_um");
}

constexpr const char* minutes_of_night =
    "SELECT setup.columns::text, extract(epoch FROM at)::bigint, value::text FROM fleet.minute"
    " JOIN fleet.setup ON setup.machine = minute.machine AND setup.number = minute.setup"
    " WHERE minute.machine = $1 AND at >= $2::date AND at < $2::date + 1 ORDER BY at";
constexpr const char* probings_of_night =
    "SELECT extract(epoch FROM date_trunc('minute', at))::bigint, output, avg(displacement_um)"
    " FROM fleet.probing WHERE machine = $1 AND at >= $2::date AND at < $2::date + 1 GROUP BY 1, 2";

/// Elements of a PostgreSQL array, {a,NULL,"b c"}; our names need no escapes.
std::vector<std::string> elements(const std::string& array) {
  std::vector<std::string> all;
  std::string element;
  for (const char c : array.substr(1)) {
    if (c == ',' || c == '}') {
      all.push_back(element == "NULL" || element == "NaN" ? "" : element);
      element.clear();
    } else if (c != '"') {
      element += c;
    }
  }
  return all;
}

std::string last_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line, last;
  while (std::getline(in, line))
    if (!line.empty()) last = line;
  return printable_text(last);
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream(file) << text;
}

std::optional<std::string> series_of(pqxx::connection& store, const MachineNight& night,
                                     const std::string& kind) {
  pqxx::read_transaction work(store);
  const pqxx::result found = work.exec_params(
      "SELECT content FROM fleet.series WHERE type = $1 AND kind = $2 AND machine = $3"
      " AND through < $4::date ORDER BY through DESC LIMIT 1",
      night.type, kind, night.machine, night.night);
  if (found.empty()) return std::nullopt;
  return found[0][0].as<std::string>();
}

struct Verdict {
  bool departs{false};
  double probability{1.0};
  nlohmann::json answer = nullptr;  ///< "departure" of `inspect`
};

/// Uses the answer, since exit status 1 can also mean a fault of the recording.
Verdict compared(const WorkFolder& folder, const fs::path& run, const std::string& series) {
  write_text(folder / "series.toml", series);
  run_modelling({"inspect", run.string(), "--series", folder / "series.toml", "--json",
                 folder / "answer.json"},
                folder / "log");
  Verdict verdict;
  verdict.answer = nlohmann::json::parse(read_text_file(folder / "answer.json"))
                       .value("departure", nlohmann::json());
  for (const auto& output : verdict.answer) {
    verdict.departs = verdict.departs || output.value("departs", false);
    verdict.probability = std::min(verdict.probability, output.value("probability", 1.0));
  }
  return verdict;
}

/// Largest subject of the departing output: "column_degC, 6.1 um".
std::string subject_text(const nlohmann::json& answer) {
  for (const auto& [name, output] : answer.items()) {
    if (!output.value("departs", false) || output["subjects"].empty()) continue;
    const auto& first = output["subjects"][0];
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(), "%s: %s, %.1f um", name.c_str(),
                  first.value("subject", std::string()).c_str(), first.value("effect_um", 0.0));
    return text.data();
  }
  return "its residual is larger than its sisters'";
}

/// True if the last compared night was unusual too; a single one happens by chance.
bool was_unusual(pqxx::connection& store, const MachineNight& night) {
  pqxx::nontransaction work(store);
  const pqxx::result before = work.exec_params(
      "SELECT coalesce((departure ->> 'unusual')::boolean, false) FROM fleet.night_result"
      " WHERE machine = $1 AND night < $2::date AND departs IS NOT NULL"
      " ORDER BY night DESC, finished DESC LIMIT 1",
      night.machine, night.night);
  return !before.empty() && before[0][0].as<bool>();
}

/// Runs `diagnose` with the model in use: trains on the three nights before, tests this one.
nlohmann::json diagnosed(pqxx::connection& store, const MachineNight& night,
                         const WorkFolder& folder, const fs::path& run) {
  pqxx::nontransaction work(store);
  const pqxx::result model = work.exec_params(
      "SELECT content FROM fleet.document WHERE checksum = (SELECT model FROM fleet.setup WHERE"
      " machine = $1 ORDER BY number DESC LIMIT 1) AND content <> ''",
      night.machine);
  if (model.empty()) return nullptr;
  write_text(folder / "model.toml", model[0][0].as<std::string>());
  std::vector<std::string> arguments{"diagnose", "--model", folder / "model.toml", "--train"};
  const pqxx::result days = work.exec_params(
      "SELECT ($1::date - days)::text FROM generate_series(3, 1, -1) AS days", night.night);
  work.commit();
  const std::size_t before = arguments.size();
  for (const pqxx::row& day : days) {
    MachineNight earlier = night;
    earlier.night = day[0].as<std::string>();
    const fs::path file = folder / (earlier.night + ".csv");
    if (write_run(store, earlier, file) >= probings_min) arguments.push_back(file.string());
  }
  if (arguments.size() == before) return nullptr;
  for (const std::string& more :
       {std::string("--test"), run.string(), std::string("--json"), folder / "cause.json"})
    arguments.push_back(more);
  run_modelling(arguments, folder / "log");
  return nlohmann::json::parse(read_text_file(folder / "cause.json"));
}

constexpr const char* write_result =
    "INSERT INTO fleet.night_result (machine, night, model, program_version, state, statistics,"
    " departs, probability, remainder_um, claimed_um, departure, diagnosis, error, took_s)"
    " SELECT $1, $2::date, coalesce((SELECT model FROM fleet.setup WHERE machine = $1"
    "   ORDER BY number DESC LIMIT 1), ''), $3, $4, $5, $6::boolean, $7::real,"
    "   sqrt(avg((displacement_um - modelled_um) ^ 2)), sqrt(avg(claimed_um ^ 2)), $8::jsonb,"
    "   $9::jsonb, $10, $11::real"
    " FROM fleet.probing WHERE machine = $1 AND at >= $2::date AND at < $2::date + 1"
    " ON CONFLICT (machine, night, model, program_version) DO UPDATE SET state = excluded.state,"
    " statistics = excluded.statistics, departs = excluded.departs, probability ="
    " excluded.probability, remainder_um = excluded.remainder_um, claimed_um = excluded.claimed_um,"
    " departure = excluded.departure, diagnosis = excluded.diagnosis, error = excluded.error,"
    " took_s = excluded.took_s, finished = now()";

struct Result {
  std::string state{"done"};
  std::optional<std::string> statistics;
  std::optional<bool> departs;
  std::optional<double> probability;
  nlohmann::json departure = nullptr;
  nlohmann::json diagnosis = nullptr;
  std::optional<std::string> error;
  double took_s{0.0};
};

void write(pqxx::connection& store, const MachineNight& night, const Result& result) {
  const auto text = [](const nlohmann::json& json) {
    return json.is_null() ? std::nullopt : std::optional(json.dump());
  };
  const auto pointer = [](const std::optional<std::string>& value) {
    return value ? value->c_str() : nullptr;
  };
  const auto departs =
      result.departs ? std::optional<std::string>(*result.departs ? "t" : "f") : std::nullopt;
  const auto probability =
      result.probability ? std::optional(number_text(*result.probability)) : std::nullopt;
  const auto departure = text(result.departure);
  const auto diagnosis = text(result.diagnosis);
  pqxx::work work(store);
  work.exec_params0(write_result, night.machine, night.night, THERMOCOMP_VERSION, result.state,
                    pointer(result.statistics), pointer(departs), pointer(probability),
                    pointer(departure), pointer(diagnosis), pointer(result.error), result.took_s);
  work.commit();
}

}  // namespace

WorkFolder::WorkFolder() {
  std::string name = (fs::temp_directory_path() / "thermocomp-night-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw std::system_error(errno, std::generic_category(), "a temporary folder");
  path_ = name;
}
WorkFolder::~WorkFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

int run_and_wait(const std::string& program, const std::vector<std::string>& arguments,
                 const fs::path& log) {
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments)
    words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  if (!log.empty()) {
    posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&files, 1, 2);
  }
  pid_t child = 0;
  const int failed = posix_spawnp(&child, program.c_str(), &files, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (failed != 0) throw std::system_error(failed, std::generic_category(), program);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int run_modelling(const std::vector<std::string>& arguments, const fs::path& log) {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  const int status = run_and_wait((folder / "thermocomp-modelling").string(), arguments, log);
  if (status > 1)
    throw std::runtime_error(std::string(arguments.front()).append(": ").append(last_line(log)));
  return status;
}

int write_run(pqxx::connection& store, const MachineNight& night, const fs::path& file) {
  pqxx::nontransaction work(store);
  std::map<std::int64_t, std::map<std::string, std::string>> rows;
  std::vector<std::string> columns;
  std::vector<std::string> outputs;
  const auto note = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const pqxx::row& row : work.exec_params(minutes_of_night, night.machine, night.night)) {
    const std::vector<std::string> names = elements(row[0].as<std::string>());
    const std::vector<std::string> values = elements(row[2].as<std::string>());
    for (std::size_t i = 0; i < std::min(names.size(), values.size()); ++i) {
      if (!is_column_of_run(names[i])) continue;
      note(columns, names[i]);
      rows[row[1].as<std::int64_t>()][names[i]] = values[i];
    }
  }
  for (const pqxx::row& row : work.exec_params(probings_of_night, night.machine, night.night)) {
    const auto output = row[1].as<std::string>();
    note(outputs, output);
    // Skips probings in minutes without a sample, since these have no temperatures.
    if (const auto found = rows.find(row[0].as<std::int64_t>()); found != rows.end())
      found->second[output] = row[2].as<std::string>();
  }
  columns.insert(columns.end(), outputs.begin(), outputs.end());
  std::ofstream out(file);
  out << "time_s";
  for (const std::string& column : columns) out << ',' << column;
  out << '\n';
  int probed = 0;
  for (auto& [at_s, values] : rows) {
    out << at_s - rows.begin()->first;
    for (const std::string& column : columns) out << ',' << values[column];
    out << '\n';
    probed += !outputs.empty() &&
              std::all_of(outputs.begin(), outputs.end(),
                          [&values = values](const auto& name) { return !values[name].empty(); });
  }
  if (!out.flush()) throw std::runtime_error(file.string() + ": could not be written");
  return probed;
}

NightOutcome evaluate_night(pqxx::connection& store, const MachineNight& night) {
  const auto began = std::chrono::steady_clock::now();
  const WorkFolder folder;
  {
    pqxx::work work(store);
    work.exec_params("SELECT fleet.make_minutes($1, $2::date)", night.machine, night.night);
    work.commit();
  }
  Result result;
  std::string text = "no series yet";
  const fs::path run = folder / (night.night + ".csv");
  if (write_run(store, night, run) < probings_min) {
    result.state = "empty";
    text = "too few probings";
  } else {
    run_modelling(
        {"series", "--machine", night.name, run.string(), "-o", folder / "statistics.toml"},
        folder / "log");
    result.statistics = read_text_file(folder / "statistics.toml");
    result.departure = nlohmann::json::object();
    bool is_judged = false;
    bool is_unusual = false;
    for (const std::string kind : {"sisters", "own_past"}) {
      const std::optional<std::string> series = series_of(store, night, kind);
      if (!series) continue;
      const Verdict verdict = compared(folder, run, *series);
      result.departure[kind] = verdict.answer;
      result.probability = std::min(result.probability.value_or(1.0),
                                    std::max(verdict.probability, probability_least));
      if (verdict.departs)
        text = std::string("from its ") + (kind == "sisters" ? kind : "own past") + ", " +
               subject_text(verdict.answer);
      is_judged = true;
      is_unusual = is_unusual || verdict.departs;
    }
    if (is_judged) {
      result.departs = is_unusual && was_unusual(store, night);
      result.departure["unusual"] = is_unusual;
      text = !is_unusual ? "as usual" : (*result.departs ? "DEPARTS " : "unusual, ") + text;
    }
    if (result.departs.value_or(false)) result.diagnosis = diagnosed(store, night, folder, run);
  }
  result.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  write(store, night, result);
  return {result.departs.value_or(false), text};
}

void note_failure(pqxx::connection& store, const MachineNight& night, const std::string& why) {
  Result result;
  result.state = "failed";
  result.error = why;
  write(store, night, result);
}

namespace {

/// A machine with enough nights before the one under test.
struct Ready {
  int machine{0};
  bool has_past{false};
  std::vector<std::string> runs;
  std::string statistics;
};

/// Creates missing minute means of a night, which with `--slurm` the series need before the tasks.
constexpr const char* make_missing_minutes =
    "SELECT fleet.make_minutes($1, $2::date) FROM fleet.uplink WHERE machine = $1 AND NOT EXISTS"
    " (SELECT FROM fleet.minute WHERE machine = $1 AND at >= $2::date AND at < $2::date + 1)"
    " GROUP BY machine HAVING max(newest) >= $2::date + 1";

/// Writes the machines' runs and statistics into the folder.
std::vector<Ready> ready_machines(pqxx::connection& store, const WorkFolder& folder,
                                  const std::string& type, const pqxx::result& machines,
                                  const pqxx::result& days) {
  std::vector<Ready> ready;
  for (const pqxx::row& machine : machines) {
    MachineNight each{machine[0].as<int>(), machine[1].as<std::string>(), type, ""};
    Ready of_machine{each.machine, machine[2].as<bool>(), {}, folder / (each.name + ".toml")};
    for (const pqxx::row& day : days) {
      each.night = day[0].as<std::string>();
      pqxx::work work(store);
      work.exec_params(make_missing_minutes, each.machine, each.night);
      work.commit();
      const fs::path file = folder / (each.name + "_" + each.night + ".csv");
      if (write_run(store, each, file) >= probings_min) of_machine.runs.push_back(file);
    }
    if (of_machine.runs.size() < nights_of_series) continue;
    std::vector<std::string> arguments{"series", "--machine", each.name, "-o",
                                       of_machine.statistics};
    arguments.insert(arguments.end(), of_machine.runs.begin(), of_machine.runs.end());
    run_modelling(arguments, folder / "log");
    ready.push_back(std::move(of_machine));
  }
  return ready;
}

}  // namespace

void make_series(pqxx::connection& store, const std::string& type, const std::string& night) {
  pqxx::nontransaction work(store);
  const bool is_there = !work.exec_params(
                                 "SELECT FROM fleet.series WHERE type = $1 AND kind = 'type' AND "
                                 "through < $2::date AND"
                                 " through >= $2::date - $3::int",
                                 type, night, nights_of_series)
                             .empty();
  const pqxx::result machines = work.exec_params(
      "SELECT id, name, EXISTS (SELECT FROM fleet.series WHERE machine = machine.id AND kind ="
      " 'own_past') AS has_past FROM fleet.machine WHERE type = $1 ORDER BY name",
      type);
  const pqxx::result days = work.exec_params(
      "SELECT ($1::date - days)::text FROM generate_series($2::int, 1, -1) AS days", night,
      nights_of_series);
  work.commit();
  if (is_there) return;
  const WorkFolder folder;
  const std::vector<Ready> ready = ready_machines(store, folder, type, machines, days);
  if (std::ssize(ready) <= machines_min) return;
  const auto keep = [&](const char* kind, const Ready* machine, std::size_t count,
                        const std::string& file) {
    const std::string id = machine != nullptr ? std::to_string(machine->machine) : "";
    pqxx::work keeping(store);
    keeping.exec_params0(
        "INSERT INTO fleet.series (type, kind, machine, through, machines, program_version, "
        "content)"
        " VALUES ($1, $2, nullif($3, '')::int, $4::date - 1, $5, $6, $7) ON CONFLICT DO NOTHING",
        type, kind, id, night, count, THERMOCOMP_VERSION, read_text_file(file));
    keeping.commit();
  };
  /// Makes the series of all machines except one group. @return number of machines
  const auto make = [&](std::size_t groups, std::size_t left_out, const std::string& file) {
    std::vector<std::string> arguments{"series", "-o", file};
    for (std::size_t i = 0; i < ready.size(); ++i)
      if (i % groups != left_out && arguments.size() < sisters_max)
        arguments.push_back(ready[i].statistics);
    run_modelling(arguments, folder / "log");
    return arguments.size() - 3;
  };
  // Excludes each machine from its own series; with many machines, half of them at a time.
  const std::size_t groups = ready.size() < 8 ? ready.size() : 2;
  for (std::size_t group = 0; group < groups; ++group) {
    const std::string sisters = folder / "sisters.toml";
    const std::size_t count = make(groups, group, sisters);
    for (std::size_t i = group; i < ready.size(); i += groups) {
      keep("sisters", &ready[i], count, sisters);
      if (ready[i].has_past) continue;
      std::vector<std::string> past{"series", "--machine", "its past",          "--prior",
                                    sisters,  "-o",        folder / "past.toml"};
      past.insert(past.end(), ready[i].runs.begin(), ready[i].runs.end());
      run_modelling(past, folder / "log");
      keep("own_past", &ready[i], 1, folder / "past.toml");
    }
  }
  // Kept last: it marks the week's series as complete.
  const std::size_t count = make(1, 1, folder / "type.toml");
  keep("type", nullptr, count, folder / "type.toml");
}

}  // namespace thermocomp::fleet
