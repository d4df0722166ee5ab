// thermocomp_faults: runs many thousand hours of daemon lives with faults.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "life.hpp"
#include "plants.hpp"

namespace {

using namespace thermocomp::faults;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string seeds{"0:32"};
  double hours{4.0};
  double cycle_hz{1.0};
  std::string planted;
  std::string only;
  std::string history{"/dev/shm/thermocomp_faults"};
  unsigned history_every{16};
  unsigned threads{std::max(1u, std::thread::hardware_concurrency())};
  bool list{false};
  bool verbose{false};
  bool expect_found{false};
  bool complete{false};
};

std::pair<std::uint64_t, std::uint64_t> parse_seeds(const std::string& text) {
  const std::size_t colon = text.find(':');
  std::size_t used = 0;
  const std::uint64_t first = std::stoull(text, &used);
  if (colon == std::string::npos) return {first, first + 1};
  if (used != colon) throw std::invalid_argument(text);
  return {first, std::stoull(text.substr(colon + 1))};
}

class Campaign {
 public:
  explicit Campaign(const Options& options) : options_(options) {
    std::tie(next_, end_) = parse_seeds(options.seeds);
    first_ = next_;
    total_.pairs.reset();
    history_folder_ = std::filesystem::path(options.history) / std::to_string(getpid());
  }
  Campaign(const Campaign&) = delete;
  Campaign& operator=(const Campaign&) = delete;
  ~Campaign() {
    std::error_code ignored;
    std::filesystem::remove_all(history_folder_, ignored);
  }

  void run() {
    began_ = Clock::now();
    std::vector<std::thread> threads;
    for (unsigned i = 0; i < options_.threads; ++i) threads.emplace_back([this] { work(); });
    for (std::thread& thread : threads) thread.join();
  }

  int report() const {
    const double took_s = std::chrono::duration<double>(Clock::now() - began_).count();
    std::uint64_t faults = 0;
    for (std::size_t i = 0; i < fault_kinds; ++i) {
      fmt::print("{:<26} {:>9}\n", name_of(static_cast<FaultKind>(i)), total_.faults[i]);
      faults += total_.faults[i];
    }
    fmt::print("lives                      {:>9}\n", lives_);
    fmt::print("machine hours              {:>9.0f}\n", total_.machine_hours);
    fmt::print("virtual cycles             {:>9}\n", total_.cycles);
    fmt::print("  compensating             {:>9.1f} %\n",
               100.0 * static_cast<double>(total_.compensating) /
                   static_cast<double>(std::max<std::uint64_t>(1, total_.cycles)));
    fmt::print("  replayed to the bit      {:>9}\n", total_.replayed);
    fmt::print("starts, reloads            {:>9} {:>9}\n", total_.restarts, total_.reloads);
    fmt::print("promoted, taken back       {:>9} {:>9}\n", total_.promotions, total_.taken_back);
    fmt::print("commits on disk checked    {:>9}\n", total_.commits);
    fmt::print("faults                     {:>9}\n", faults);
    fmt::print("pairs of faults            {:>9} of {}\n", total_.pairs.count(), fault_pairs);
    fmt::print("invariants broken          {:>9}\n", broken_);
    fmt::print("machine hours a second     {:>9.1f}   ({:.1f} s)\n", total_.machine_hours / took_s,
               took_s);
    if (options_.expect_found) return report_found();
    if (options_.complete && (!total_.pairs.all() || total_.taken_back == 0)) {
      fmt::print("not every pair of kinds of faults came up, or no release was taken back\n");
      return 1;
    }
    return broken_ == 0 ? 0 : 1;
  }

 private:
  void work() {
    while (true) {
      std::uint64_t seed = 0;
      {
        const std::lock_guard lock(mutex_);
        if (next_ == end_ || (options_.expect_found && broken_ != 0)) return;
        seed = next_++;
      }
      LifeOptions life;
      life.seed = seed;
      life.hours = options_.hours;
      life.cycle_hz = options_.cycle_hz;
      life.verbose = options_.verbose;
      life.only = kind_of(options_.only);
      life.state_folder = history_folder_ / ("state" + std::to_string(seed));
      if (options_.history_every != 0 && seed % options_.history_every == 0)
        life.history_folder = history_folder_;
      add(seed, live(life));
    }
  }

  void add(std::uint64_t seed, const LifeResult& result) {
    const std::lock_guard lock(mutex_);
    ++lives_;
    total_.cycles += result.cycles;
    total_.machine_hours += result.machine_hours;
    total_.replayed += result.replayed;
    total_.restarts += result.restarts;
    total_.reloads += result.reloads;
    total_.promotions += result.promotions;
    total_.taken_back += result.taken_back;
    total_.commits += result.commits;
    total_.compensating += result.compensating;
    total_.pairs |= result.pairs;
    for (std::size_t i = 0; i < fault_kinds; ++i) total_.faults[i] += result.faults[i];
    if (result.broken) note(seed, *result.broken);
    const auto now = Clock::now();
    if (now - printed_at_ < std::chrono::seconds(2) || options_.verbose) return;
    printed_at_ = now;
    fmt::print(stderr, "\r{:3.0f} %  {} lives, {:.0f} machine hours, {} broken ",
               100.0 * static_cast<double>(lives_) / static_cast<double>(end_ - first_), lives_,
               total_.machine_hours, broken_);
  }

  void note(std::uint64_t seed, const Broken& broken) {
    ++broken_;
    if (!found_ || seed < found_->first) found_ = {seed, broken};
    if (!options_.expect_found && broken_ <= 12) print(seed, broken);
  }

  void print(std::uint64_t seed, const Broken& broken) const {
    const double at_s = 1e-9 * static_cast<double>(broken.at.count()) - 3600.0;
    fmt::print("BROKEN {} in seed {} at {:.2f} s: {}\n", broken.invariant, seed, at_s,
               broken.detail);
    fmt::print(
        "  again: {} --seeds {}:{} --hours {} --cycle-hz {} --history-every {}{} --verbose\n",
        program_name, seed, seed + 1, options_.hours, options_.cycle_hz, options_.history_every,
        (options_.planted.empty() ? "" : " --planted " + options_.planted) +
            (options_.only.empty() ? "" : " --only " + options_.only));
    std::fflush(stdout);
  }

  /// All smaller seeds have been completed: the answer does not depend on the number of threads.
  int report_found() const {
    if (!found_) return 1;
    const auto& [seed, broken] = *found_;
    print(seed, broken);
    const double in_life_h = 1e-9 * static_cast<double>(broken.at.count()) / 3600.0 - 1.0;
    fmt::print("FOUND {} {} {:.1f}\n", broken.invariant, seed,
               static_cast<double>(seed - first_) * options_.hours + in_life_h);
    return 0;
  }

  const Options& options_;
  std::filesystem::path history_folder_;
  std::uint64_t first_{0};
  std::uint64_t next_{0};
  std::uint64_t end_{0};
  mutable std::mutex mutex_;
  LifeResult total_;
  std::uint64_t lives_{0};
  std::uint64_t broken_{0};
  std::optional<std::pair<std::uint64_t, Broken>> found_;  ///< the smallest seed of them
  Clock::time_point began_{};
  Clock::time_point printed_at_{};
};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "Runs the daemon's own code against a simulated machine with faults, in virtual time"};
  app.add_option("--seeds", options.seeds, "FIRST:END, one life a seed")->capture_default_str();
  app.add_option("--hours", options.hours, "virtual hours of a life")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--cycle-hz", options.cycle_hz, "rate of the cycle")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 1000.0));
  app.add_option("--planted", options.planted, "a bug to plant; --list names them");
  app.add_option("--only", options.only, "one kind of fault, no other; --list names them");
  app.add_option("--history", options.history,
                 "folder for the histories that are really written, one in it a process")
      ->capture_default_str();
  app.add_option("--history-every", options.history_every,
                 "seeds that are a multiple of this write a real history; 0: none")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "lives at once")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_flag("--expect-found", options.expect_found,
               "stop at the first broken invariant; exit status 0 if there was one");
  app.add_flag("--complete", options.complete,
               "exit status 1 too unless every pair of kinds of faults came up");
  app.add_flag("--list", options.list, "kinds of faults, invariants and planted bugs");
  app.add_flag("--verbose", options.verbose,
               "the faults and what becomes of them; one life at once");
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::off);
  if (options.list) {
    for (std::size_t i = 0; i < fault_kinds; ++i)
      fmt::print("fault      {}\n", name_of(static_cast<FaultKind>(i)));
    for (const thermocomp::invariants::Invariant& each : thermocomp::invariants::all)
      fmt::print("invariant  {}: {}\n", each.name, each.text);
    for (const std::string& name : plant_names()) fmt::print("planted    {}\n", name);
    return 0;
  }
  if (options.verbose) options.threads = 1;
  if (!options.only.empty() && !kind_of(options.only)) {
    fmt::print(stderr, "{}: no kind of fault is called {}; --list names them\n", program_name,
               options.only);
    return 2;
  }
  if (!options.planted.empty() && !plant(options.planted)) {
    fmt::print(stderr, "{}: no planted bug is called {} in this build; --list names them\n",
               program_name, options.planted);
    return 2;
  }
  try {
    Campaign campaign(options);
    campaign.run();
    return campaign.report();
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", program_name, error.what());
    return 2;
  }
}
