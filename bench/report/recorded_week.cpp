/// A history of a week, in a minute: the daemon's own estimator, recorder, writer and events,
/// stepped in virtual time through a simulated run, with what happens in a week planted in it.
///
///     bench_recorded_week CONFIG.toml RUN.csv HISTORY.db
///
/// The configuration says `dry_run = true`; from the third day on it is run without.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <spdlog/spdlog.h>

#include "config/daemon/daemon_config.hpp"
#include "config/runs/run_file.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "daemon/status/event_journal.hpp"
#include "daemon/status/event_log.hpp"
#include "daemon/status/event_record.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace {

using namespace thermocomp;
using std::chrono::seconds;

constexpr double hour_s = 3600.0;
/// Monday, 2026-03-02 07:00 UTC; hours below count from here.
constexpr std::int64_t begin_wall_s = 1772434800;
constexpr int reading_every_s = 10;
constexpr double probing_noise_um = 0.3;

struct Spell {
  double from_h;
  double to_h;
  [[nodiscard]] bool holds(double time_s) const {
    return from_h * hour_s <= time_s && time_s < to_h * hour_s;
  }
};

// What happens. The daemon runs in three stretches, the first a dry run.
constexpr std::array<Spell, 3> runs{{{0.0, 49.0}, {49.1, 110.0}, {119.0, 168.0}}};
constexpr Spell bus_away{78.0, 78.2};
constexpr Spell loose{99.0, 107.0};  ///< column_left shows more than it is
constexpr double loose_K = 3.0;
constexpr Spell broken{126.0, 126.7};  ///< spindle
constexpr Spell controller_off{148.0, 148.3};
constexpr Spell switched_off{150.0, 151.0};
/// Of each day.
constexpr std::array<double, 2> probings_h{2.5, 8.0};

std::string content_of(const std::string& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// The daemon's configuration with or without its dry run.
DaemonConfig config_of(const std::string& file, bool dry_run) {
  DaemonConfig config = load_daemon_config(file);
  std::string text = config.text;
  const std::string key = "dry_run = true";
  const std::size_t at = text.find(key);
  if (at == std::string::npos) throw std::runtime_error(file + ": has no line " + key);
  if (!dry_run) text.replace(at, key.size(), "dry_run = false");
  return parse_daemon_config(text, file, config.model_text, config.model_file.string());
}

double between_rows(const RunFile& run, const std::string& column, double time_s) {
  const auto& times = run.time_s();
  const auto& values = run.column(column);
  const double place = time_s / (times[1] - times[0]);
  const auto row = std::min(static_cast<std::size_t>(place), times.size() - 2);
  const double share = place - static_cast<double>(row);
  return values[row] + share * (values[row + 1] - values[row]);
}

/// What all starts of the daemon share.
struct World {
  const RunFile& run;
  std::string history;
  std::int64_t now_s{0};  ///< since the beginning
  std::mt19937_64 random{17};

  double noise(double size) { return std::normal_distribution<double>(0.0, size)(random); }
  [[nodiscard]] nanoseconds monotonic() const { return seconds(1000 + now_s); }
  [[nodiscard]] nanoseconds wall() const { return seconds(begin_wall_s + now_s); }
};

/// The daemon from one start to its end.
class Run {
 public:
  Run(World& world, const DaemonConfig& config, const PersistentState* before)
      : world_(world),
        config_(config),
        estimator_(config.estimator, config.model),
        grid_{world.monotonic(), seconds(1)},
        writer_(history_config(), grid_, "bench", 65536,
                {[&world] { return world.monotonic(); }, [&world] { return world.wall(); }}),
        journal_([&world] {
          return EventJournal::Moment{world.monotonic(), world.wall()};
        }),
        log_(journal_),
        readings_(config.estimator.sensors.size()),
        report_(estimator_.make_report()) {
    if (before != nullptr) estimator_.restore(*before);
    journal_.tell([this](const Event& event) { writer_.note(recorded(event)); });
    writer_.open();
    recorder_ =
        writer_.make_recorder({config.text, config.model_text, config.model_checksum}, estimator_);
    recorder_->begin(0, estimator_, SegmentReason::start);
    journal_.daemon("started, version bench");
    controller_.link_epoch = 1;
  }

  PersistentState work_until(double end_s) {
    for (; static_cast<double>(world_.now_s) < end_s; ++world_.now_s) {
      step();
      writer_.work();
    }
    recorder_->finish(cycle_ - 1, command_);
    journal_.daemon("stopped");
    writer_.stop();
    PersistentState state = estimator_.persistent_state(report_);
    if (config_.dry_run) state.offset_um.clear();  // they were not sent
    return state;
  }

 private:
  [[nodiscard]] HistoryConfig history_config() const {
    HistoryConfig history = config_.history;
    history.file = world_.history;
    return history;
  }

  void step() {
    const auto time_s = static_cast<double>(world_.now_s);
    const nanoseconds now = grid_.time_of(cycle_);
    if (world_.now_s % reading_every_s == 0) read_sensors(time_s, now);
    read_controller(time_s, now);
    give_commands(time_s);
    estimator_.step(now, readings_, controller_, command_);
    recorder_->record(cycle_++, readings_, controller_, command_, estimator_);
    estimator_.report(report_);
    log_.note_report(report_, config_.estimator, config_.dry_run);
    if (bus_away.holds(time_s))
      journal_.fault("bus cabinet", "no answer");
    else
      journal_.recovery("bus cabinet");
  }

  void read_sensors(double time_s, nanoseconds now) {
    for (std::size_t i = 0; i < readings_.size(); ++i) {
      const std::string& name = config_.estimator.sensors[i].name;
      Reading& reading = readings_[i];
      reading.taken_at = now;
      reading.fault = Fault::none;
      if (bus_away.holds(time_s)) reading.fault = Fault::no_answer;
      if (name == "spindle" && broken.holds(time_s)) reading.fault = Fault::open_circuit;
      reading.temp_degC = between_rows(world_.run, name + "_degC", time_s) + world_.noise(0.02);
      if (name == "column_left" && loose.holds(time_s)) reading.temp_degC += loose_K;
      if (reading.fault != Fault::none) reading.temp_degC = not_a_number;
    }
  }

  void read_controller(double time_s, nanoseconds now) {
    controller_.online = !controller_off.holds(time_s);
    if (!controller_.online) return;
    controller_.taken_at = now;
    ++controller_.look;
    for (std::size_t i = 0; i < config_.estimator.axes.size(); ++i)
      controller_.applied_um[i] = command_.offset_um[i];
    for (std::size_t i = 0; i < config_.estimator.signals.size(); ++i)
      controller_.signals[i] = between_rows(world_.run, config_.estimator.signals[i], time_s);
  }

  void give(const Command& command, const std::string& said) {
    estimator_.apply(command);
    recorder_->command(cycle_, command);
    journal_.command(said, 1000);
  }

  void give_commands(double time_s) {
    const auto is_now = [time_s](double hour) { return std::abs(time_s - hour * hour_s) < 0.5; };
    if (is_now(switched_off.from_h)) give({CommandKind::disable, 0, 0.0}, "disable");
    if (is_now(switched_off.to_h)) give({CommandKind::enable, 0, 0.0}, "enable");
    for (const double hour : probings_h)
      if (is_now(24.0 * std::floor(time_s / 24.0 / hour_s) + hour)) probe(time_s);
  }

  /// The last axis: what a dial would show there.
  void probe(double time_s) {
    const std::size_t axis = config_.estimator.axes.size() - 1;
    const AxisConfig& probed = config_.estimator.axes[axis];
    double shown_um = between_rows(world_.run, probed.output, time_s);
    if (!config_.dry_run) shown_um += probed.sign * command_.offset_um[axis];
    shown_um = std::round(10.0 * (shown_um + world_.noise(probing_noise_um))) / 10.0;
    char said[64];
    std::snprintf(said, sizeof said, "measured %s %g um", probed.name.c_str(), shown_um);
    give({CommandKind::measured, static_cast<std::uint32_t>(axis), shown_um}, said);
  }

  World& world_;
  const DaemonConfig& config_;
  Estimator estimator_;
  Grid grid_;
  HistoryWriter writer_;
  EventJournal journal_;
  EventLog log_;
  std::unique_ptr<CycleRecorder> recorder_;
  std::vector<Reading> readings_;
  Report report_;
  ControllerState controller_;
  OffsetCommand command_;
  std::uint64_t cycle_{0};
};

void record(const std::string& config_file, const std::string& run_file,
            const std::string& history) {
  const DaemonConfig dry = config_of(config_file, true);
  const DaemonConfig live = config_of(config_file, false);
  const RunFile run = parse_run(content_of(run_file), run_file);
  World world{run, history};
  PersistentState state;
  bool is_first = true;
  for (const Spell& spell : runs) {
    world.now_s = std::llround(spell.from_h * hour_s);
    Run daemon(world, is_first ? dry : live, is_first ? nullptr : &state);
    state = daemon.work_until(std::min(spell.to_h * hour_s, run.time_s().back()));
    is_first = false;
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4) {
    std::fputs("bench_recorded_week CONFIG.toml RUN.csv HISTORY.db\n", stderr);
    return 2;
  }
  spdlog::set_level(spdlog::level::off);
  try {
    record(arguments[1], arguments[2], arguments[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
