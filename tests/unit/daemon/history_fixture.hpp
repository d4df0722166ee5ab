/// A machine without buses: the real estimator with random inputs by seed, recorded as by the
/// daemon.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "../temp_folder.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp::testing {

inline ReplaySetup machine_setup(double gain_um_per_K) {
  ReplaySetup setup;
  for (const char* name : {"bed", "column", "spindle"}) {
    SensorConfig sensor;
    sensor.name = name;
    sensor.smoothing.period_s = 1.0;
    sensor.screening.settle_s = 0.0;
    setup.estimator.sensors.push_back(sensor);
    BlockConfig block;
    block.name = name;
    block.input = std::string(name) + "_in_degC";
    block.sensors = {setup.estimator.sensors.size() - 1};
    setup.estimator.blocks.push_back(block);
    setup.model.inputs.push_back(block.input);
  }
  setup.estimator.signals = {"spindle_rpm"};
  setup.estimator.compensation.enabled_at_first_start = true;
  for (const char* name : {"y", "z"}) {
    AxisConfig axis;
    axis.name = name;
    axis.output = std::string(name) + "_um";
    setup.estimator.axes.push_back(axis);
    setup.model.outputs.push_back(axis.output);
    setup.model.matrix_um_per_K.push_back({gain_um_per_K, -1.5, 3.25});
  }
  return setup;
}

/// Configuration text of these tests: the gain of the model.
inline ReplaySetup parse_test_setup(const SegmentSetup& setup) {
  return machine_setup(std::stod(setup.config_text));
}

class RecordedMachine {
 public:
  RecordedMachine(const HistoryConfig& config, unsigned seed, std::size_t ring_records = 65536,
                  const WriterClocks& clocks = system_clocks())
      : random_(seed), writer_(config, grid_, "test", ring_records, clocks), readings_(3) {
    use(2.0);
  }

  HistoryWriter& writer() { return writer_; }
  [[nodiscard]] const Estimator& estimator() const { return *estimator_; }
  [[nodiscard]] std::uint64_t next_cycle() const { return next_cycle_; }

  void start() {
    writer_.start();
    recorder_->begin(0, *estimator_, SegmentReason::start);
  }
  /// Without the writer's thread: the test calls writer().work().
  void open() {
    writer_.open();
    recorder_->begin(0, *estimator_, SegmentReason::start);
  }
  void stop() {
    if (next_cycle_ > 0) recorder_->finish(next_cycle_ - 1, command_);
    writer_.stop();
  }

  void reload(double gain_um_per_K) {
    auto old_estimator = std::move(estimator_);
    auto old_recorder = std::move(recorder_);
    use(gain_um_per_K);
    estimator_->plan_adoption(*old_estimator);
    estimator_->adopt(*old_estimator);
    recorder_->begin(next_cycle_, *estimator_, SegmentReason::reload, old_recorder.get());
  }

  /// Readings about once a second, with occasional faults, commands and skipped cycles.
  void run(std::uint64_t cycles) {
    for (const std::uint64_t end = next_cycle_ + cycles; next_cycle_ < end; ++next_cycle_) {
      if (one_in(500)) {
        const std::uint64_t count = 1 + random_() % 20;
        recorder_->skipped(next_cycle_, next_cycle_ + count - 1);
        next_cycle_ += count;
      }
      change_inputs();
      if (one_in(300)) give_command();
      estimator_->step(grid_.time_of(next_cycle_), readings_, controller_, command_);
      recorder_->record(next_cycle_, readings_, controller_, command_, *estimator_);
    }
  }

 private:
  void use(double gain_um_per_K) {
    const ReplaySetup setup = machine_setup(gain_um_per_K);
    estimator_ = std::make_unique<Estimator>(setup.estimator, setup.model);
    recorder_ = writer_.make_recorder({std::to_string(gain_um_per_K), "model", "sum"}, *estimator_);
  }
  bool one_in(unsigned n) { return random_() % n == 0; }

  void change_inputs() {
    const nanoseconds now = grid_.time_of(next_cycle_);
    for (Reading& reading : readings_) {
      if (!one_in(60)) continue;
      reading.taken_at = now - nanoseconds(random_() % 1000000);
      reading.fault = one_in(40) ? Fault::open_circuit : Fault::none;
      const double drift = 20.0 + 1e-4 * static_cast<double>(next_cycle_);
      reading.temp_degC = reading.fault == Fault::none
                              ? drift + 0.01 * static_cast<double>(random_() % 10)
                              : not_a_number;
    }
    if (one_in(10)) {
      if (one_in(400)) ++controller_.link_epoch;
      controller_.link_epoch = std::max(controller_.link_epoch, 1u);
      controller_.online = !one_in(200);
      controller_.written = controller_.online;
      controller_.taken_at = now;
      for (std::size_t i = 0; i < 2; ++i) controller_.applied_um[i] = command_.offset_um[i];
      controller_.signals[0] = static_cast<double>(random_() % 3) * 1000.0;
    }
  }
  void give_command() {
    Command command;
    command.kind = static_cast<CommandKind>(random_() % command_kinds_count);
    command.axis = static_cast<std::uint32_t>(random_() % 2);
    command.value_um = 1.0 + static_cast<double>(random_() % 5);
    estimator_->apply(command);
    recorder_->command(next_cycle_, command);
  }

  std::mt19937 random_;
  Grid grid_{std::chrono::hours(7), std::chrono::milliseconds(10)};
  HistoryWriter writer_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<CycleRecorder> recorder_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
  std::uint64_t next_cycle_{0};
};

inline HistoryConfig history_config(const std::filesystem::path& file) {
  HistoryConfig config;
  config.file = file;
  config.commit_s = 0.1;
  config.offsets_period_s = 0.1;
  return config;
}

struct Exported {
  std::string text;
  ExportSummary summary;
};
inline Exported exported(const std::filesystem::path& file,
                         const std::optional<HistoryTime>& from = {},
                         const std::optional<HistoryTime>& to = {}) {
  std::ostringstream out;
  ExportSummary summary = export_run(file, from, to, out, {}, parse_test_setup);
  return {out.str(), std::move(summary)};
}

/// Records cycles before and after a reload.
inline HistoryConfig recorded_history(const std::filesystem::path& file, std::uint64_t cycles,
                                      std::uint64_t after_reload = 0, unsigned seed = 3) {
  const HistoryConfig config = history_config(file);
  RecordedMachine machine(config, seed);
  machine.start();
  machine.run(cycles);
  if (after_reload > 0) {
    machine.reload(3.0);
    machine.run(after_reload);
  }
  machine.stop();
  return config;
}

}  // namespace thermocomp::testing
