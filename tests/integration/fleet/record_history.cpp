// Records hours of history in seconds: the daemon's estimator and writer in virtual time, with a
// machine that warms and cools by seed and a probed tool.
//   record_history CONFIG HISTORY BEGIN_UNIX_S HOURS SEED PROBINGS_PER_H [CLOCK_AT_S CLOCK_BY_S]
// The wall clock is set by CLOCK_BY_S at CLOCK_AT_S and back again 10 min later. On an existing
// history this is another start of the daemon. Prints {"probings": N}.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace {

using namespace thermocomp;

struct Course {
  double begin_s{0.0};
  double hours{0.0};
  unsigned seed{0};
  double probings_per_h{0.0};
  double clock_at_s{-1.0};
  double clock_by_s{0.0};
};

class Machine {
 public:
  Machine(const DaemonConfig& config, const Course& course)
      : course_(course),
        period_s_(1.0 / config.loop.rate_hz),
        random_(course.seed),
        writer_(config.history, grid_, "test", 65536,
                {[this] { return now_; }, [this] { return wall(); }}),
        estimator_(config.estimator, config.model),
        recorder_(writer_.make_recorder({config.text, config.model_text, config.model_checksum},
                                        estimator_)),
        readings_(config.estimator.sensors.size()) {}

  int run() {
    writer_.open();
    recorder_->begin(0, estimator_, SegmentReason::start);
    note("started");
    const auto cycles = static_cast<std::uint64_t>(course_.hours * 3600.0 / period_s_);
    const auto minute = static_cast<std::uint64_t>(60.0 / period_s_);
    // As many cycles between commits as a daemon at 100 Hz; a change of the clock is recorded by
    // the next commit.
    const std::uint64_t commits = course_.clock_at_s < 0 ? 600 : 4;
    for (std::uint64_t cycle = 0; cycle < cycles; ++cycle) {
      now_ = grid_.time_of(cycle);
      show_readings(period_s_ * static_cast<double>(cycle));
      if (cycle > 100 && uniform() < course_.probings_per_h * period_s_ / 3600.0) probe(cycle);
      estimator_.step(now_, readings_, controller_, command_);
      recorder_->record(cycle, readings_, controller_, command_, estimator_);
      if (cycle % commits == 0) writer_.work();
      if (cycle % (60 * minute) == 0) note("hour " + std::to_string(cycle / (60 * minute)));
    }
    recorder_->finish(cycles - 1, command_);
    writer_.stop();
    std::printf("{\"probings\": %d, \"events\": %d}\n", probings_, events_);
    return 0;
  }

 private:
  [[nodiscard]] nanoseconds wall() const {
    const double passed_s = 1e-9 * static_cast<double>((now_ - grid_.start).count());
    double wall_s = course_.begin_s + passed_s;
    if (course_.clock_at_s >= 0 && passed_s >= course_.clock_at_s &&
        passed_s < course_.clock_at_s + 600)
      wall_s += course_.clock_by_s;
    return nanoseconds(static_cast<std::int64_t>(1e9 * wall_s));
  }
  double uniform() { return std::uniform_real_distribution<double>()(random_); }

  void show_readings(double time_s) {
    for (std::size_t i = 0; i < readings_.size(); ++i) {
      const double slow_s = 3000.0 + 700.0 * static_cast<double>(i);
      const double temp_degC =
          22.0 + static_cast<double>(i) + 5.0 * std::sin(time_s / slow_s + course_.seed);
      readings_[i] = {std::round(100.0 * temp_degC) / 100.0, now_, Fault::none};
    }
    controller_.online = controller_.written = true;
    controller_.link_epoch = 1;
    controller_.taken_at = now_;
    controller_.applied_um[0] = command_.offset_um[0];
  }

  void probe(std::uint64_t cycle) {
    const Command measured{CommandKind::measured, 0, 4.0 * uniform()};
    estimator_.apply(measured);
    recorder_->command(cycle, measured);
    ++probings_;
  }

  void note(const std::string& what) {
    Event event;
    event.number = static_cast<std::uint64_t>(++events_);
    event.wall_s = 1e-9 * static_cast<double>(wall().count());
    event.code = what;
    writer_.note(event);
  }

  Course course_;
  double period_s_;
  std::mt19937 random_;
  Grid grid_{std::chrono::hours(7), nanoseconds(static_cast<std::int64_t>(1e9 * period_s_))};
  nanoseconds now_{grid_.start};
  HistoryWriter writer_;
  Estimator estimator_;
  std::unique_ptr<CycleRecorder> recorder_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
  int probings_{0};
  int events_{0};
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7 && argc != 9) return 2;
  const auto number = [&](int i) { return std::strtod(argv[i], nullptr); };
  Course course{number(3), number(4), static_cast<unsigned>(number(5)), number(6)};
  if (argc == 9) {
    course.clock_at_s = number(7);
    course.clock_by_s = number(8);
  }
  try {
    DaemonConfig config = load_daemon_config(argv[1]);
    config.history.file = argv[2];
    config.history.commit_s = 60.0;  // fewer syncs to disk
    return Machine(config, course).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
