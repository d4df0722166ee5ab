#include "simulator/session/session.hpp"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <poll.h>
#include <stdexcept>
#include <unistd.h>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/signalfd.h>

#include "config/runs/run_file.hpp"
#include "config/text/clean_output.hpp"
#include "simulator/devices/event_loop.hpp"
#include "simulator/devices/field_nodes.hpp"
#include "simulator/plant/plant.hpp"
#include "simulator/session/simulated_machine.hpp"
#include "simulator/session/truth_record.hpp"

namespace thermocomp {
namespace {

/// {"ready": true, "ports": {...}, "paths": {...}, "unavailable": {...}}
std::string ready_line(const std::vector<BusPlace>& places) {
  nlohmann::ordered_json line{{"ready", true},
                              {"ports", nlohmann::json::object()},
                              {"paths", nlohmann::json::object()},
                              {"unavailable", nlohmann::json::object()}};
  for (const BusPlace& place : places) {
    if (!place.unavailable.empty()) {
      line["unavailable"][place.name] = place.unavailable;
    } else if (place.kind == SimulatedBusKind::modbus_tcp) {
      line["ports"][place.name] = place.port;
    } else {
      line["paths"][place.name] = place.path;
    }
  }
  return line.dump();
}

/// SIGINT and SIGTERM as a file descriptor, so that the summary is always printed.
class StopSignals {
 public:
  explicit StopSignals(EventLoop& loop) : loop_(loop) {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigprocmask(SIG_BLOCK, &set, nullptr);
    file_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    if (file_ < 0) throw std::runtime_error("signalfd failed");
    loop_.watch(file_, POLLIN, [this](short) { loop_.stop(); });
  }
  ~StopSignals() {
    loop_.unwatch(file_);
    ::close(file_);
  }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  EventLoop& loop_;
  int file_{-1};
};

/// A line on stderr that overwrites itself; silent without a terminal.
class StatusLine {
 public:
  ~StatusLine() {
    if (shown_) std::fputc('\n', stderr);
  }
  void show(nanoseconds now, double plant_s, const TruthRecord& truth) {
    if (!on_terminal_ || now < next_) return;
    next_ = now + from_seconds(0.25);
    shown_ = true;
    std::fprintf(stderr, "%s%splant %7.3f h   error at the tool", terminal_code("[G").c_str(),
                 terminal_code("[K").c_str(), plant_s / 3600.0);
    for (const double error : truth.last_error_um()) std::fprintf(stderr, " %7.2f", error);
    std::fprintf(stderr, " um   rms %.2f um, uncompensated %.2f um", truth.compensated_rms_um(),
                 truth.uncompensated_rms_um());
    std::fflush(stderr);
  }

 private:
  bool on_terminal_{::isatty(STDERR_FILENO) == 1};
  bool shown_{false};
  nanoseconds next_{};
};

class Session {
 public:
  Session(const MachineConfig& machine, const SessionOptions& options,
          const std::vector<std::string>& columns, const std::string& source)
      : options_(options),
        stop_signals_(loop_),
        truth_(columns, options.truth),
        devices_(loop_, machine, columns, source),
        nodes_(machine, columns, source),
        row_(columns.size(), 0.0) {}
  virtual ~Session() = default;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void run() {
    first_row();
    devices_.update(EventLoop::now(), 0.0, row_, true);
    announce();
    started_ = EventLoop::now();
    start();
    nodes_.switch_on(started_);
    tick(started_);
    loop_.run();
    finish();
    truth_.close();
    if (truth_.has_outputs()) std::cout << truth_.summary() << std::endl;
  }

 protected:
  virtual void first_row() = 0;  ///< sets row_ for the start
  virtual void start() = 0;
  virtual void on_tick(nanoseconds now) = 0;
  virtual void finish() {}

  void record(double plant_s) {
    truth_.add(plant_s, row_,
               [this](const std::string& output) { return devices_.applied_um(output); });
  }
  void end() {
    if (!options_.stay) loop_.stop();
  }

  SessionOptions options_;
  EventLoop loop_;
  StopSignals stop_signals_;
  TruthRecord truth_;
  SimulatedMachine devices_;
  FieldNodes nodes_;
  StatusLine status_;
  std::vector<double> row_;
  nanoseconds started_{};

 private:
  void announce() {
    std::vector<BusPlace> places = devices_.places();
    for (const FieldNodes::Place& node : nodes_.places()) {
      places.push_back({node.name, SimulatedBusKind::can, 0, node.interface, node.unavailable});
    }
    const std::string line = ready_line(places);
    for (const BusPlace& place : places) {
      if (place.unavailable.empty()) continue;
      std::cerr << "thermocomp-sim: " << place.name << " is unavailable: " << place.unavailable
                << std::endl;
    }
    if (!options_.ports_file.empty()) {
      // Renamed when complete, so that a waiting program never reads a partial file.
      const std::filesystem::path draft = options_.ports_file.string() + ".new";
      std::ofstream(draft) << line << '\n';
      std::error_code error;
      std::filesystem::rename(draft, options_.ports_file, error);
      if (error) throw std::runtime_error(options_.ports_file.string() + ": cannot be written");
    }
    std::cout << line << std::endl;
  }

  void tick(nanoseconds due) {
    const nanoseconds now = EventLoop::now();
    on_tick(now);
    nodes_.update(now, row_);
    const nanoseconds next = std::max(due + from_seconds(options_.tick_s), now);
    loop_.at(next, [this, next] { tick(next); });
  }
};

class PlantSession : public Session {
 public:
  PlantSession(const MachineConfig& machine, const SessionOptions& options)
      : Session(machine, options, Plant(*machine.plant, machine.seed).columns(), "the plant"),
        plant_(*machine.plant, machine.seed),
        pitch_s_(machine.pitch_s),
        running_(!options.start_on_heartbeat) {}

 private:
  void first_row() override {
    plant_.advance_to(0.0);
    plant_.row(row_);
  }
  void start() override {}

  void on_tick(nanoseconds now) override {
    if (!running_ && devices_.heartbeat_seen()) {
      running_ = true;
      started_ = now;
    }
    double plant_s = running_ ? seconds_of(now - started_) * options_.time_factor : 0.0;
    const bool over = options_.duration_s > 0.0 && plant_s >= options_.duration_s;
    if (over && !options_.stay) plant_s = options_.duration_s;
    while (running_ && static_cast<double>(recorded_) * pitch_s_ <= plant_s) {
      const double time_s = static_cast<double>(recorded_) * pitch_s_;
      plant_.advance_to(time_s);
      plant_.row(row_);
      record(time_s);
      ++recorded_;
    }
    plant_.advance_to(plant_s);
    plant_.row(row_);
    devices_.update(now, plant_s, row_, false);
    status_.show(now, plant_s, truth_);
    if (over) end();
  }

  Plant plant_;
  double pitch_s_;
  bool running_;
  std::uint64_t recorded_{0};
};

class ReplaySession : public Session {
 public:
  ReplaySession(const MachineConfig& machine, const SessionOptions& options, RunFile run)
      : Session(machine, options, run.columns, options.replay.string()), run_(std::move(run)) {
    end_ = std::min(options_.row_end, run_.rows());
    if (options_.row_begin >= end_) {
      throw std::runtime_error("--rows: no such rows; " + run_.name +
                               " has rows 0:" + std::to_string(run_.rows()));
    }
    if (!options_.row_log.empty()) {
      log_.open(options_.row_log);
      if (!log_) throw std::runtime_error(options_.row_log.string() + ": cannot be written");
      log_ << "row,monotonic_ns\n";
    }
  }

 private:
  [[nodiscard]] double plant_s(std::size_t row) const {
    return run_.time_s()[row] - run_.time_s()[options_.row_begin];
  }
  [[nodiscard]] nanoseconds due(std::size_t row) const {
    const double after_s =
        options_.row_period_s > 0.0
            ? static_cast<double>(row - options_.row_begin) * options_.row_period_s
            : plant_s(row) / options_.time_factor;
    return started_ + from_seconds(after_s);
  }
  void take_row(std::size_t row) {
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] = run_.values[i][row];
    shown_ = row;
  }

  void first_row() override { take_row(options_.row_begin); }
  void start() override {
    waiting_ = options_.start_on_heartbeat;
    show(options_.row_begin);
  }

  void show(std::size_t row) {
    if (row != options_.row_begin) record(plant_s(shown_));
    take_row(row);
    devices_.update(EventLoop::now(), plant_s(row), row_, true);
    if (log_.is_open()) log_ << row << ',' << EventLoop::now().count() << '\n';
    if (!waiting_) schedule_after(row);
  }

  void schedule_after(std::size_t row) {
    if (row + 1 < end_) {
      loop_.at(due(row + 1), [this, row] { show(row + 1); });
    } else {
      loop_.at(EventLoop::now() + from_seconds(options_.settle_s), [this] { end(); });
    }
  }

  void on_tick(nanoseconds now) override {
    if (waiting_ && devices_.heartbeat_seen()) {
      waiting_ = false;
      started_ = now;
      schedule_after(shown_);
    }
    devices_.update(now, plant_s(shown_), row_, false);
    status_.show(now, plant_s(shown_), truth_);
  }

  void finish() override {
    record(plant_s(shown_));
    if (!log_.is_open()) return;
    log_.close();
    if (!log_) throw std::runtime_error(options_.row_log.string() + ": could not be written");
  }

  RunFile run_;
  std::size_t end_{0};
  std::size_t shown_{0};
  bool waiting_{false};
  std::ofstream log_;
};

}  // namespace

void run_session(const MachineConfig& machine, const SessionOptions& options) {
  if (!options.replay.empty()) {
    RunFile run = load_run({options.replay});
    for (const std::string& line : run.understood)
      std::fprintf(stderr, "%s: %s\n", run.name.c_str(), line.c_str());
    ReplaySession(machine, options, std::move(run)).run();
  } else if (machine.plant) {
    PlantSession(machine, options).run();
  } else {
    throw std::runtime_error("the machine file has no [plant]: give a run file with --replay");
  }
}

}  // namespace thermocomp
