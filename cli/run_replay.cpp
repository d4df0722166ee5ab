#include "cli/run_replay.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "config/number_text.hpp"
#include "config/problems.hpp"
#include "estimator/estimator.hpp"

namespace thermocomp::cli {

namespace {

using Column = std::vector<double>;

nanoseconds time_of(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

const Column* find_column(const RunFile& run, const std::string& name) {
  const auto index = run.find(name);
  return index ? &run.values[*index] : nullptr;
}

// The input of the block that a sensor belongs to; empty: none.
std::string input_of_sensor(const EstimatorConfig& config, std::size_t sensor) {
  for (const BlockConfig& block : config.blocks) {
    const auto& members = block.sensors;
    if (std::find(members.begin(), members.end(), sensor) != members.end()) return block.input;
  }
  return {};
}

std::vector<const Column*> sensor_columns(const EstimatorConfig& config, const RunFile& run) {
  std::vector<const Column*> columns;
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < config.sensors.size(); ++i) {
    const std::string own = config.sensors[i].name + "_degC";
    const std::string input = input_of_sensor(config, i);
    const Column* column = find_column(run, own);
    if (column == nullptr && !input.empty()) column = find_column(run, input);
    if (column == nullptr) {
      std::string rule = "a column of this name is needed for the sensor " + config.sensors[i].name;
      if (!input.empty() && input != own) rule += ", or one called " + input;
      problems.push_back({run.name, 0, own, "(missing)", std::move(rule)});
    }
    columns.push_back(column);
  }
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
  return columns;
}

// A machine whose past is a run file: readings and controller as the estimator sees them.
class RecordedMachine {
 public:
  RecordedMachine(const EstimatorConfig& config, const RunFile& run)
      : axes_(config.axes.size()),
        sensors_(sensor_columns(config, run)),
        readings_(config.sensors.size()) {
    for (const std::string& signal : config.signals) signals_.push_back(find_column(run, signal));
    controller_.online = true;
    controller_.link_epoch = 1;
    std::fill_n(controller_.applied_um.begin(), axes_, 0.0);
  }

  void take_row(std::size_t row, nanoseconds taken_at) {
    for (std::size_t i = 0; i < sensors_.size(); ++i) {
      const double value = (*sensors_[i])[row];
      if (std::isfinite(value)) readings_[i] = {value, taken_at, Fault::none};
    }
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      controller_.signals[i] = signals_[i] != nullptr ? (*signals_[i])[row] : not_a_number;
    }
  }

  void step(Estimator& estimator, nanoseconds now) {
    controller_.taken_at = now;
    estimator.step(now, readings_, controller_, command_);
    for (std::size_t i = 0; i < axes_; ++i) {
      if (command_.valid[i]) controller_.applied_um[i] = command_.offset_um[i];
    }
  }

  [[nodiscard]] double offset_um(std::size_t axis) const { return command_.offset_um[axis]; }

 private:
  std::size_t axes_;
  std::vector<const Column*> sensors_;
  std::vector<const Column*> signals_;  ///< nullptr: the run file has no such column
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
};

RunFile empty_result(const EstimatorConfig& config, const RunFile& run) {
  RunFile result;
  result.name = run.name;
  result.columns.emplace_back("time_s");
  for (const AxisConfig& axis : config.axes) {
    result.columns.push_back(axis.name + "_offset_um");
    result.columns.push_back(axis.name + "_target_um");
  }
  result.values.resize(result.columns.size());
  return result;
}

void add_row(RunFile& result, double time_s, const RecordedMachine& machine, const Report& report) {
  result.values[0].push_back(time_s);
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    result.values[1 + 2 * i].push_back(machine.offset_um(i));
    result.values[2 + 2 * i].push_back(report.axes[i].target_um);
  }
  result.selected_end = result.values[0].size();
}

}  // namespace

RunFile replay_run(const DaemonConfig& config, const RunFile& run,
                   const std::function<void(double)>& progress) {
  RecordedMachine machine(config.estimator, run);
  Estimator estimator(config.estimator, config.model);
  estimator.apply({CommandKind::enable, 0, 0.0});
  Report report = estimator.make_report();
  RunFile result = empty_result(config.estimator, run);

  const nanoseconds period = time_of(1.0 / config.loop.rate_hz);
  const Column& time_s = run.time_s();
  // A second before the first row would be the daemon's start; times then are never negative.
  const nanoseconds shift = std::chrono::seconds(1) - time_of(time_s.front());
  nanoseconds now = std::chrono::seconds(1);
  for (std::size_t row = 0; row < run.selected_end; ++row) {
    const nanoseconds taken_at = time_of(time_s[row]) + shift;
    for (; now < taken_at; now += period) machine.step(estimator, now);
    machine.take_row(row, taken_at);
    machine.step(estimator, now);
    now += period;
    if (row >= run.selected_begin) {
      estimator.report(report);
      add_row(result, time_s[row], machine, report);
    }
    if (progress) progress(static_cast<double>(row) / static_cast<double>(run.selected_end));
  }
  return result;
}

std::vector<std::string> doubts_about(const DaemonConfig& config, const RunFile& run) {
  std::vector<std::string> doubts;
  const Column& time_s = run.time_s();
  if (time_s.size() > 1) {
    const double pitch_s =
        (time_s.back() - time_s.front()) / static_cast<double>(time_s.size() - 1);
    for (const SensorConfig& sensor : config.estimator.sensors) {
      if (sensor.screening.stale_after_s > pitch_s) continue;
      doubts.push_back("the run file has a row every " + number_text(pitch_s) +
                       " s on average, but readings count as stale after " +
                       number_text(sensor.screening.stale_after_s) +
                       " s (screening.stale_after_s)");
      break;
    }
  }
  for (const std::string& signal : config.estimator.signals) {
    const auto needed = config.model.signal_columns();
    if (run.find(signal) || std::find(needed.begin(), needed.end(), signal) == needed.end()) {
      continue;
    }
    doubts.push_back("the run file has no column " + signal + ", which the model needs");
  }
  return doubts;
}

}  // namespace thermocomp::cli
