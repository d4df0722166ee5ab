#include "fleet/night/night_command.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
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

struct NightOptions {
  int nights{30};
  unsigned jobs{std::max(1u, std::thread::hardware_concurrency())};
};

struct Tally {
  std::mutex printing;
  std::atomic<std::size_t> next{0};
  std::size_t done{0};
  std::size_t failed{0};
  std::size_t departing{0};
};

/// Until all are taken. What fails is noted, and does not stop the others.
void work_off_some(const std::string& conninfo, const std::vector<MachineNight>& nights,
                   std::size_t all, Tally& tally) {
  pqxx::connection store = open_store(conninfo);
  for (std::size_t i = tally.next++; i < nights.size(); i = tally.next++) {
    const MachineNight& night = nights[i];
    NightOutcome outcome;
    bool has_failed = false;
    try {
      outcome = work_off(store, night);
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

std::vector<MachineNight> open_nights(pqxx::connection& store, int nights) {
  pqxx::read_transaction work(store);
  std::vector<MachineNight> all;
  for (const pqxx::row& row :
       work.exec_params("SELECT machine, name, type, night::text FROM fleet.open_nights("
                        "(now() AT TIME ZONE 'UTC')::date - $1::int, $2)",
                        nights, THERMOCOMP_VERSION))
    all.push_back({row[0].as<int>(), row[1].as<std::string>(), row[2].as<std::string>(),
                   row[3].as<std::string>()});
  return all;
}

/// Night by night, since what is judged is compared with what was before it.
int run(const std::string& conninfo, const NightOptions& options) {
  pqxx::connection store = open_store(conninfo);
  const std::vector<MachineNight> all = open_nights(store, options.nights);
  Tally tally;
  for (auto begin = all.begin(); begin != all.end();) {
    const auto end = std::find_if(
        begin, all.end(), [&](const MachineNight& each) { return each.night != begin->night; });
    const std::vector<MachineNight> nights(begin, end);
    std::set<std::string> types;
    for (const MachineNight& each : nights) types.insert(each.type);
    for (const std::string& type : types) {
      try {
        make_series(store, type, begin->night);
      } catch (const std::exception& error) {
        std::fprintf(stderr, "series of %s: %s\n", type.c_str(), error.what());
      }
    }
    tally.next = 0;
    std::vector<std::thread> threads;
    for (unsigned i = 0; i < std::min<std::size_t>(options.jobs, nights.size()); ++i)
      threads.emplace_back([&] {
        try {
          work_off_some(conninfo, nights, all.size(), tally);
        } catch (const std::exception& error) {  // the store is gone; the rest is open still
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

}  // namespace

void add_night_command(CLI::App& app, const std::string& store, cli::Action& action) {
  auto options = std::make_shared<NightOptions>();
  CLI::App* command = app.add_subcommand(
      "night",
      "compares every machine's days that are over with its sisters and with its own past");
  command
      ->add_option("--nights", options->nights, "how far back it looks for days without a result")
      ->check(CLI::Range(1, 400))
      ->capture_default_str();
  command->add_option("-j,--jobs", options->jobs, "machines at the same time; else one a core")
      ->check(CLI::Range(1, 256));
  command->footer(
      "Exit status: 0 nothing departs; 1 a machine departs or a night failed (it is tried again); "
      "2 bad "
      "use, or the store is not reached.");
  command->callback(
      [&store, &action, options] { action = [&store, options] { return run(store, *options); }; });
}

}  // namespace thermocomp::fleet
