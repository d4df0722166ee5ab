/// Offset error with lost sensors: the estimator with measured temperatures of a spindle, with each
/// sensor lost in turn, and with every pair.
///
/// Two folds: the covariance is fitted to one half of the record and sensors are lost in the other.
/// A sensor is lost (open circuit) every two hours for one hour, and again for eight. Error: the
/// offset less the offset with all sensors, at every row of the outage, all axes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "cli/model/covariance_fit.hpp"
#include "config/model/model_file.hpp"
#include "config/runs/run_file.hpp"
#include "measured_machine.hpp"

namespace thermocomp {
namespace {

constexpr double apart_s = 7200.0;
constexpr double normal_95 = 1.96;
constexpr std::array<double, 2> outages_h{1.0, 8.0};

using Lost = std::vector<std::size_t>;

EstimatorConfig make_config(const ThermalModel& model, bool estimate) {
  EstimatorConfig config = measured_config(model, 40.0);  // rows are 15 s apart
  config.compensation.estimate_lost_blocks = estimate;
  config.compensation.offset_sd_um_max = 500.0;  // no limit
  return config;
}

/// Sums over rows and axes.
struct Tally {
  double square_um2{0.0};
  double hold_square_um2{0.0};
  double variance_um2{0.0};
  std::size_t inside{0};
  std::size_t count{0};
  void add(const Tally& other) {
    square_um2 += other.square_um2;
    hold_square_um2 += other.hold_square_um2;
    variance_um2 += other.variance_um2;
    inside += other.inside;
    count += other.count;
  }
  [[nodiscard]] double rms_um() const { return std::sqrt(square_um2 / static_cast<double>(count)); }
  [[nodiscard]] double hold_rms_um() const {
    return std::sqrt(hold_square_um2 / static_cast<double>(count));
  }
  [[nodiscard]] double sd_um() const {
    return std::sqrt(variance_um2 / static_cast<double>(count));
  }
  [[nodiscard]] double coverage_percent() const {
    return 100.0 * static_cast<double>(inside) / static_cast<double>(count);
  }
};

/// One half of the record with the covariance of the other.
class Fold {
 public:
  Fold(const ThermalModel& model, const RunFile& run, std::size_t begin, std::size_t end)
      : model_(model),
        estimating_(make_config(model, true), model),
        holding_(make_config(model, false), model) {
    for (std::size_t row = begin; row < end; ++row) {
      times_s_.push_back(run.time_s()[row]);
      auto& temps_degC = temps_degC_.emplace_back();
      for (const std::string& input : model.inputs) temps_degC.push_back(run.column(input)[row]);
    }
    walk_through();
  }

  [[nodiscard]] Tally lose(const Lost& lost, double hours) {
    Tally tally;
    for (const Start& start : starts_) {
      const double end_s = times_s_[start.row] + 3600.0 * hours;
      if (end_s > times_s_.back()) break;
      estimating_.load(start.estimating);
      holding_.load(start.holding);
      for (std::size_t row = start.row; row < times_s_.size() && times_s_[row] < end_s; ++row) {
        estimating_.step(times_s_[row], temps_degC_[row], lost);
        holding_.step(times_s_[row], temps_degC_[row], lost);
        // An open circuit counts once the last good reading is stale.
        const Report& report = estimating_.report();
        if (has_reason(report.reasons, Reason::block_estimated)) count(row, report, tally);
      }
    }
    return tally;
  }

 private:
  struct Start {
    std::size_t row;
    std::vector<std::byte> estimating;
    std::vector<std::byte> holding;
  };

  void walk_through() {
    double next_s = times_s_.front() + 600.0;
    for (std::size_t row = 0; row < times_s_.size(); ++row) {
      if (times_s_[row] >= next_s) {
        starts_.push_back({row, estimating_.state(), holding_.state()});
        next_s += apart_s;
      }
      estimating_.step(times_s_[row], temps_degC_[row]);
      holding_.step(times_s_[row], temps_degC_[row]);
      truth_um_.push_back(estimating_.offsets().offset_um);
    }
  }

  void count(std::size_t row, const Report& report, Tally& tally) {
    for (std::size_t axis = 0; axis < model_.outputs.size(); ++axis) {
      const double error_um = estimating_.offsets().offset_um[axis] - truth_um_[row][axis];
      const double hold_um = holding_.offsets().offset_um[axis] - truth_um_[row][axis];
      const double sd_um = report.axes[axis].offset_sd_um;
      tally.square_um2 += error_um * error_um;
      tally.hold_square_um2 += hold_um * hold_um;
      tally.variance_um2 += sd_um * sd_um;
      if (std::abs(error_um) <= normal_95 * sd_um) ++tally.inside;
      ++tally.count;
    }
  }

  ThermalModel model_;
  MeasuredMachine estimating_;
  MeasuredMachine holding_;
  std::vector<double> times_s_;
  std::vector<std::vector<double>> temps_degC_;
  std::vector<std::array<double, axes_max>> truth_um_;
  std::vector<Start> starts_;
};

std::vector<Fold> make_folds(ThermalModel model, RunFile run) {
  const std::size_t half = run.rows() / 2;
  std::vector<Fold> folds;
  for (const bool first : {true, false}) {
    run.selected_begin = first ? 0 : half;
    run.selected_end = first ? half : run.rows();
    const cli::CovarianceFit fit = cli::fit_covariance({&run, 1}, model.inputs);
    model.covariance_K2 = fit.matrix_K2;
    model.covariance_growth = fit.growth;
    folds.emplace_back(model, run, first ? half : 0, first ? run.rows() : half);
  }
  return folds;
}

Tally lose(std::vector<Fold>& folds, const Lost& lost, double hours) {
  Tally tally;
  for (Fold& fold : folds) tally.add(fold.lose(lost, hours));
  return tally;
}

void print_row(const char* name, const Tally& tally) {
  std::printf("%-20s %10.3f %10.3f %10.3f %8.1f %10.1f\n", name, tally.rms_um(), tally.sd_um(),
              tally.hold_rms_um(), tally.hold_rms_um() / tally.rms_um(), tally.coverage_percent());
}

void print_result(const std::string& name, const Tally& tally, std::string& last) {
  const auto add = [&](const char* what, double value, const char* unit) {
    char line[160];
    std::snprintf(line, sizeof line, "%s_%s %.4g %s\n", name.c_str(), what, value, unit);
    last += line;
  };
  add("rms_estimated", tally.rms_um(), "um");
  add("rms_held", tally.hold_rms_um(), "um");
  add("held_over_estimated", tally.hold_rms_um() / tally.rms_um(), "ratio");
  add("coverage_95", tally.coverage_percent(), "percent");
}

int run(const std::filesystem::path& folder) {
  const ThermalModel model = load_model(folder / "static_model.toml");
  std::vector<Fold> folds = make_folds(model, load_run({folder / "hours_00_32.csv"}));
  std::string last;
  for (const double hours : outages_h) {
    std::printf("outage of %.0f h\n%-20s %10s %10s %10s %8s %10s\n", hours, "lost", "rms um",
                "stated sd", "hold um", "ratio", "within 95 %");
    Tally singles;
    for (std::size_t i = 0; i < model.inputs.size(); ++i) {
      const Tally tally = lose(folds, {i}, hours);
      print_row(model.inputs[i].c_str(), tally);
      singles.add(tally);
    }
    print_row("each of 16", singles);
    Tally pairs;
    Tally worst;
    double lowest_percent = 100.0;
    std::string worst_name;
    for (std::size_t i = 0; i < model.inputs.size(); ++i)
      for (std::size_t k = i + 1; k < model.inputs.size(); ++k) {
        const Tally tally = lose(folds, {i, k}, hours);
        pairs.add(tally);
        lowest_percent = std::min(lowest_percent, tally.coverage_percent());
        if (worst.count > 0 && tally.rms_um() <= worst.rms_um()) continue;
        worst = tally;
        worst_name = model.inputs[i] + "+" + model.inputs[k];
      }
    print_row("all 120 pairs", pairs);
    print_row(worst_name.c_str(), worst);
    std::printf("lowest coverage of a pair: %.1f %%\n\n", lowest_percent);
    const std::string name = hours < 2.0 ? "1h" : "8h";
    print_result("single_" + name, singles, last);
    print_result("pair_" + name, pairs, last);
  }
  std::printf("%s", last.c_str());
  return 0;
}

}  // namespace
}  // namespace thermocomp

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr,
                 "usage: bench_lost_sensors FOLDER (of hours_00_32.csv, static_model.toml)\n");
    return 2;
  }
  try {
    return thermocomp::run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lost_sensors: %s\n", error.what());
    return 2;
  }
}
