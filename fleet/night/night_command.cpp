#include "fleet/night/night_command.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <pqxx/pqxx>
#include <set>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "fleet/night/machine_night.hpp"
#include "fleet/store/store.hpp"

namespace thermocomp::fleet {
namespace {

using Nights = std::vector<MachineNight>;

struct NightOptions {
  int nights{30};
  bool is_slurm{false};
  int machine{0};  ///< 0: all
  unsigned jobs{std::max(1u, std::thread::hardware_concurrency())};
};

struct Tally {
  std::mutex printing;
  std::atomic<std::size_t> next{0};
  std::size_t done{0};
  std::size_t failed{0};
  std::size_t departing{0};
};

/// Works until all nights are taken. A failure is stored and does not stop the others.
void evaluate_some(const std::string& conninfo, const Nights& nights, std::size_t all,
                   Tally& tally) {
  pqxx::connection store = open_store(conninfo);
  for (std::size_t i = tally.next++; i < nights.size(); i = tally.next++) {
    const MachineNight& night = nights[i];
    NightOutcome outcome;
    bool has_failed = false;
    try {
      outcome = evaluate_night(store, night);
    } catch (const std::exception& error) {
      has_failed = true;
      outcome.text = std::string("failed: ") + error.what();
      note_failure(store, night, error.what());
    }
    const std::scoped_lock lock(tally.printing);
    ++tally.done;
    tally.failed += has_failed;
    tally.departing += outcome.departs;
    std::printf("%zu/%zu %s %s: %s\n", tally.done, all, night.night.c_str(), night.name.c_str(),
                outcome.text.c_str());
    std::fflush(stdout);
  }
}

Nights open_nights(pqxx::connection& store, const NightOptions& options) {
  pqxx::read_transaction work(store);
  Nights all;
  for (const pqxx::row& row :
       work.exec_params("SELECT machine, name, type, night::text FROM fleet.open_nights("
                        "(now() AT TIME ZONE 'UTC')::date - $1::int, $2) WHERE $3 IN (0, machine)",
                        options.nights, THERMOCOMP_VERSION, options.machine))
    all.push_back({row[0].as<int>(), row[1].as<std::string>(), row[2].as<std::string>(),
                   row[3].as<std::string>()});
  return all;
}

Nights::const_iterator end_of_date(Nights::const_iterator begin, Nights::const_iterator end) {
  return std::find_if(begin, end,
                      [&](const MachineNight& each) { return each.night != begin->night; });
}

/// Makes the series for the comparison of these nights, all of one date.
void make_all_series(pqxx::connection& store, Nights::const_iterator begin,
                     Nights::const_iterator end) {
  std::set<std::string> types;
  for (auto each = begin; each != end; ++each) types.insert(each->type);
  for (const std::string& type : types) {
    try {
      make_series(store, type, begin->night);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "series of %s: %s\n", type.c_str(), error.what());
    }
  }
}

/// Date by date, since each night is compared with earlier ones.
int run_here(const std::string& conninfo, const NightOptions& options) {
  pqxx::connection store = open_store(conninfo);
  const Nights all = open_nights(store, options);
  Tally tally;
  for (auto begin = all.begin(); begin != all.end();) {
    const auto end = end_of_date(begin, all.end());
    if (options.machine == 0) make_all_series(store, begin, end);
    const Nights nights(begin, end);
    tally.next = 0;
    std::vector<std::thread> threads;
    for (unsigned i = 0; i < std::min<std::size_t>(options.jobs, nights.size()); ++i)
      threads.emplace_back([&] {
        try {
          evaluate_some(conninfo, nights, all.size(), tally);
        } catch (const std::exception& error) {  // the store is unreachable; the rest stays open
          std::fprintf(stderr, "%s\n", error.what());
          ++tally.failed;
        }
      });
    for (std::thread& thread : threads) thread.join();
    begin = end;
  }
  std::printf("%zu machine-nights, %zu depart, %zu failed\n", tally.done, tally.departing,
              tally.failed);
  return tally.failed > 0 || tally.departing > 0 ? cli::exit_no : cli::exit_success;
}

/// Slurm notation: 1-3,5.
std::string ranges(const std::set<int>& numbers) {
  std::string text;
  for (auto first = numbers.begin(); first != numbers.end();) {
    auto last = first;
    while (std::next(last) != numbers.end() && *std::next(last) == *last + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(*first);
    if (last != first) text += "-" + std::to_string(*last);
    first = std::next(last);
  }
  return text;
}

/// One job array with one task per machine; a repeated task evaluates nights without a result. The
/// series are made here first, since each needs the nights of all machines.
int run_by_slurm(const std::string& conninfo, const NightOptions& options) {
  std::set<int> machines;
  std::string began;
  {
    pqxx::connection store = open_store(conninfo);
    began = pqxx::nontransaction(store).exec1("SELECT now()")[0].as<std::string>();
    const Nights all = open_nights(store, options);
    for (auto begin = all.begin(); begin != all.end();) {
      const auto end = end_of_date(begin, all.end());
      make_all_series(store, begin, end);
      begin = end;
    }
    for (const MachineNight& each : all) machines.insert(each.machine);
    std::printf("%zu machine-nights of %zu machines\n", all.size(), machines.size());
    std::fflush(stdout);
  }
  if (!machines.empty()) {
    ::setenv("THERMOCOMP_FLEET_STORE", conninfo.c_str(), 1);  // sbatch passes it to the tasks
    // Exit status 1, a departure or a failed night, is stored, so it does not fail the task.
    const std::string task = "'" + std::filesystem::read_symlink("/proc/self/exe").string() +
                             "' night --machine-number $SLURM_ARRAY_TASK_ID --nights " +
                             std::to_string(options.nights) + "; [ $? -lt 2 ]";
    run_and_wait(
        "sbatch",
        {"--wait", "--requeue", "--job-name=thermocomp-night", "--output=thermocomp-night-%A.log",
         "--open-mode=append", "--array=" + ranges(machines), "--wrap=" + task},
        "");
  }
  pqxx::connection store = open_store(conninfo);
  const pqxx::row counts = pqxx::nontransaction(store).exec_params1(
      "SELECT count(*), count(*) FILTER (WHERE departs), count(*) FILTER (WHERE state = 'failed')"
      " FROM fleet.night_result WHERE finished >= $1::timestamptz AND program_version = $2",
      began, THERMOCOMP_VERSION);
  const auto departing = counts[1].as<std::size_t>();
  const std::size_t left = open_nights(store, options).size();
  std::printf("%zu machine-nights, %zu depart, %zu failed; %zu have no result yet\n",
              counts[0].as<std::size_t>(), departing, counts[2].as<std::size_t>(), left);
  return left > 0 || departing > 0 ? cli::exit_no : cli::exit_success;
}

}  // namespace

void add_night_command(CLI::App& app, const std::string& store, cli::Action& action) {
  auto options = std::make_shared<NightOptions>();
  CLI::App* command = app.add_subcommand(
      "night", "compares every machine's past days with its sisters and with its own past");
  command
      ->add_option("--nights", options->nights, "number of past days to check for missing results")
      ->check(CLI::Range(1, 400))
      ->capture_default_str();
  CLI::Option* jobs = command
                          ->add_option("-j,--jobs", options->jobs,
                                       "number of machines in parallel; default: one per core")
                          ->check(CLI::Range(1, 256));
  CLI::Option* slurm =
      command
          ->add_flag("--slurm", options->is_slurm,
                     "computes the series, submits one job array with a task per machine to Slurm "
                     "(sbatch) and waits for it. Every node must reach the program and the store. "
                     "Tasks write to thermocomp-night-JOB.log in this folder; the next run repeats "
                     "killed tasks")
          ->excludes(jobs);
  command
      ->add_option("--machine-number", options->machine,
                   "evaluate only the machine with this number in the store, with existing "
                   "series; used by the tasks of --slurm")
      ->check(CLI::PositiveNumber)
      ->excludes(slurm);
  command->footer(
      "Exit status: 0 no machine departs; 1 a machine departs, or a night has no result (the next "
      "run retries); 2 usage error, or the store is unreachable.");
  command->callback([&store, &action, options] {
    action = [&store, options] {
      return options->is_slurm ? run_by_slurm(store, *options) : run_here(store, *options);
    };
  });
}

}  // namespace thermocomp::fleet
