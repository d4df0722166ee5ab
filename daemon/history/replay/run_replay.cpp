#include "daemon/history/replay/run_replay.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <ostream>
#include <utility>

#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {
namespace {

constexpr double step_period_s_max = 1.0;
constexpr double steps_max = 5e8;
constexpr double stale_in_sample_distances = 2.5;
/// The first row's time on the estimator's clock; 0 means "never".
constexpr nanoseconds origin = std::chrono::seconds(1);

nanoseconds as_ns(double seconds) {
  return nanoseconds(static_cast<std::int64_t>(std::llround(seconds * 1e9)));
}

double shortest_distance_s(const std::vector<double>& times_s) {
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    shortest = std::min(shortest, times_s[i] - times_s[i - 1]);
  }
  return shortest;
}

/// Median distance of rows with a value [s]; 0 with fewer than two.
double median_distance_s(const std::vector<double>& times_s, const std::vector<double>& values) {
  std::vector<double> distances;
  std::optional<double> last;
  for (std::size_t row = 0; row < times_s.size(); ++row) {
    if (std::isnan(values[row])) continue;
    if (last) distances.push_back(times_s[row] - *last);
    last = times_s[row];
  }
  return distances.empty() ? 0.0 : median(std::move(distances));
}

nanoseconds step_period(double rate_hz, const std::vector<double>& times_s) {
  const nanoseconds loop = as_ns(1.0 / rate_hz);
  const double longest_s = std::min(step_period_s_max, shortest_distance_s(times_s));
  return loop * std::max<std::int64_t>(1, as_ns(longest_s) / loop);
}

/// The run's columns for sensors and signals.
class RunBinding {
 public:
  /// @throws ConfigurationError
  RunBinding(const DaemonConfig& config, const RunFile& run) : run_(run) {
    const EstimatorConfig& estimator = config.estimator;
    for (std::size_t i = 0; i < estimator.sensors.size(); ++i) {
      sensors_.push_back(bind_sensor(estimator, i));
    }
    for (const std::string& signal : estimator.signals) signals_.push_back(run.find(signal));
    for (const std::string& column : config.model.signal_columns()) {
      if (!run.find(column)) missing(column, "the model needs this column");
    }
    if (!problems_.empty()) throw ConfigurationError(std::move(problems_));
  }

  [[nodiscard]] const std::vector<std::optional<std::size_t>>& sensors() const { return sensors_; }
  [[nodiscard]] const std::vector<std::optional<std::size_t>>& signals() const { return signals_; }

 private:
  std::optional<std::size_t> bind_sensor(const EstimatorConfig& config, std::size_t sensor) {
    const std::string& name = config.sensors[sensor].name;
    if (const auto column = run_.find(sensor_column(name))) return column;
    for (const BlockConfig& block : config.blocks) {
      const bool is_member =
          std::find(block.sensors.begin(), block.sensors.end(), sensor) != block.sensors.end();
      if (!is_member || !run_.find(block.input)) continue;
      if (!config.sensors[sensor].reference_sensor) return run_.find(block.input);
      missing(sensor_column(name),
              "the sensor is a difference to another, so the run must have"
              " its own column");
      return std::nullopt;
    }
    if (is_needed(config, sensor)) {
      missing(sensor_column(name), "the run must have this column or that of the sensor's block");
    }
    return std::nullopt;
  }

  static bool is_needed(const EstimatorConfig& config, std::size_t sensor) {
    return is_in_a_block(config, sensor) ||
           std::any_of(config.sensors.begin(), config.sensors.end(),
                       [&](const SensorConfig& other) { return other.reference_sensor == sensor; });
  }

  void missing(const std::string& column, const std::string& rule) {
    problems_.push_back({run_.name, 0, column, "(missing)", rule});
  }

  const RunFile& run_;
  std::vector<std::optional<std::size_t>> sensors_;
  std::vector<std::optional<std::size_t>> signals_;
  std::vector<Problem> problems_;
};

/// Adapts a configuration to a run file: enabled, with limits that fit its sample distances.
EstimatorConfig adapted(EstimatorConfig config, const RunBinding& binding, const RunFile& run,
                        std::vector<std::string>& notes) {
  config.compensation.enabled_at_first_start = true;
  for (std::size_t i = 0; i < config.sensors.size(); ++i) {
    if (!binding.sensors()[i]) continue;
    // Values in a run file are settled from the first row on.
    config.sensors[i].screening.settle_s = 0.0;
    const double needed_s = stale_in_sample_distances *
                            median_distance_s(run.time_s(), run.values[*binding.sensors()[i]]);
    double& stale_after_s = config.sensors[i].screening.stale_after_s;
    if (!(needed_s > stale_after_s)) continue;
    notes.push_back("sensor " + config.sensors[i].name + ": stale_after_s is taken for " +
                    number_text(needed_s) + " instead of " + number_text(stale_after_s) +
                    ", since the run's samples are that far apart");
    stale_after_s = needed_s;
  }
  return config;
}

class RunReplay {
 public:
  RunReplay(const DaemonConfig& config, const RunFile& run, RunReplaySummary& summary)
      : run_(run),
        binding_(config, run),
        summary_(summary),
        estimator_(adapted(config.estimator, binding_, run, summary.notes), config.model),
        report_(estimator_.make_report()),
        readings_(config.estimator.sensors.size()) {
    controller_.online = true;
    controller_.written = true;
    controller_.link_epoch = 1;
    for (std::size_t i = 0; i < config.estimator.axes.size(); ++i) controller_.applied_um[i] = 0;
    assume_zero(config.estimator.compensation.cutting_signal);
    assume_zero(config.estimator.compensation.disable_signal);
  }

  void take_row(std::size_t row) {
    const nanoseconds taken_at = origin + as_ns(run_.time_s()[row] - run_.time_s()[0]);
    for (std::size_t i = 0; i < readings_.size(); ++i) {
      if (!binding_.sensors()[i]) continue;
      const double value = run_.values[*binding_.sensors()[i]][row];
      if (!std::isnan(value)) readings_[i] = {value, taken_at, Fault::none};
    }
    for (std::size_t i = 0; i < binding_.signals().size(); ++i) {
      if (binding_.signals()[i]) controller_.signals[i] = run_.values[*binding_.signals()[i]][row];
    }
  }

  void step(nanoseconds now) {
    controller_.taken_at = now;
    estimator_.step(now, readings_, controller_, command_);
    for (std::size_t i = 0; i < estimator_.config().axes.size(); ++i) {
      if (command_.valid[i]) controller_.applied_um[i] = command_.offset_um[i];
    }
    ++summary_.steps;
  }

  /// @param row  time_s, then offset and displacement of each axis
  void fill(std::vector<double>& row) {
    estimator_.report(report_);
    for (std::size_t i = 0; i < report_.axes.size(); ++i) {
      row[1 + 2 * i] = command_.offset_um[i];
      row[2 + 2 * i] = report_.axes[i].displacement_um;
    }
  }

 private:
  void assume_zero(const std::string& signal) {
    const auto& names = estimator_.config().signals;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (signal.empty() || names[i] != signal || binding_.signals()[i]) continue;
      controller_.signals[i] = 0.0;
      summary_.notes.push_back(signal + ": no such column in the run, taken for 0");
    }
  }

  const RunFile& run_;
  RunBinding binding_;
  RunReplaySummary& summary_;
  Estimator estimator_;
  Report report_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
};

}  // namespace

RunReplaySummary replay_run_file(const DaemonConfig& config, const RunFile& run,
                                 std::ostream& out) {
  RunReplaySummary summary;
  const std::vector<double>& times_s = run.time_s();
  const nanoseconds period = step_period(config.loop.rate_hz, times_s);
  summary.step_period_s = static_cast<double>(period.count()) * 1e-9;
  const double span_s = times_s.back() - times_s.front();
  if (!(span_s / summary.step_period_s <= steps_max)) {
    throw ConfigurationError({{run.name, 0, "time_s", number_text(span_s) + " s",
                               "the run must not need more than 500 million steps"}});
  }
  RunReplay replay(config, run, summary);
  std::string text = "time_s";
  for (const AxisConfig& axis : config.estimator.axes) {
    text += "," + axis.name + "_offset_um," + axis.name + "_displacement_um";
  }
  text += '\n';
  std::vector<double> values(1 + 2 * config.estimator.axes.size());
  std::size_t next_row = 0;
  for (nanoseconds now = origin; next_row < run.rows(); now += period) {
    const std::size_t first_row = next_row;
    while (next_row < run.rows() && origin + as_ns(times_s[next_row] - times_s[0]) <= now) {
      replay.take_row(next_row++);
    }
    replay.step(now);
    for (std::size_t row = std::max(first_row, run.selected_begin);
         row < std::min(next_row, run.selected_end); ++row) {
      values[0] = times_s[row];
      replay.fill(values);
      append_row(text, values);
      ++summary.rows;
    }
    out << text;
    text.clear();
  }
  return summary;
}

}  // namespace thermocomp
