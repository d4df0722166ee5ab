/// Effect of smoothing on spikes: measured temperatures of a spindle with spikes planted by seed;
/// the offset predicted by the static model, compared with the offset from the unchanged data.
///
/// Spikes, per sensor and row (15 s): 0.5 % single ones of +-1..10 K; 0.05 % begin a burst of 2 to
/// 4 rows, each with its own amplitude of +-1..10 K. Without screening.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "config/model/model_file.hpp"
#include "config/runs/run_file.hpp"
#include "estimator/sensing/sensor.hpp"

namespace thermocomp {
namespace {

constexpr int seeds = 21;
constexpr std::size_t window = 6;  ///< n of every method

using Series = std::vector<double>;  ///< one value per row
using Table = std::vector<Series>;   ///< one series per sensor or output

struct Data {
  Series time_s;
  Table temps_degC;
  std::vector<std::vector<double>> matrix_um_per_K;
};

/// Computes a sensor's values from its measured ones.
using Filter = std::function<double(const Sample&)>;
struct Method {
  std::string name;
  double pitch_s;
  std::function<Filter()> make;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Filter windowed(const std::function<double(const std::vector<double>&)>& of) {
  auto values = std::make_shared<std::deque<double>>();
  return [values, of](const Sample& sample) {
    values->push_back(sample.value_K);
    if (values->size() > window) values->pop_front();
    return of({values->begin(), values->end()});
  };
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double median_of(const std::vector<double>& values) {
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t half = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
}

Method banded(const std::string& name, SmoothingForm form, SmoothingHistory history, double pitch_s,
              double half_width_K) {
  SmoothingConfig config;
  config.form = form;
  config.history = history;
  config.period_s = 0;  // the caller chooses the pitch
  config.samples = window;
  config.half_width_K = half_width_K;
  return {name, pitch_s, [config] {
            auto smoother = std::make_shared<Smoother>(config);
            return [smoother](const Sample& sample) {
              smoother->add(sample);
              return smoother->value_K();
            };
          }};
}

std::vector<Method> methods(double half_width_K) {
  constexpr auto a = SmoothingForm::sliding_line;
  constexpr auto b = SmoothingForm::line_of_lines;
  constexpr auto raw = SmoothingHistory::raw;
  constexpr auto screened = SmoothingHistory::screened;
  return {
      {"none", 60, [] { return [](const Sample& sample) { return sample.value_K; }; }},
      {"moving_average", 60, [] { return windowed(mean_of); }},
      {"median", 60, [] { return windowed(median_of); }},
      banded("form_a_raw", a, raw, 60, half_width_K),
      banded("form_a_screened", a, screened, 60, half_width_K),
      banded("form_b_raw", b, raw, 30, half_width_K),
      banded("form_b_screened", b, screened, 30, half_width_K),
      banded("form_b_raw_15s", b, raw, 15, half_width_K),
      banded("form_b_screened_15s", b, screened, 15, half_width_K),
  };
}

nanoseconds at_second(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(time_s));
}

Data load(const std::filesystem::path& folder) {
  const ThermalModel model = load_model(folder / "static_model.toml");
  const RunFile run = load_run({folder / "hours_00_32.csv"});
  Data data{run.time_s(), {}, model.matrix_um_per_K};
  for (const std::string& input : model.inputs) data.temps_degC.push_back(run.column(input));
  return data;
}

Table with_spikes(const Table& temps_degC, unsigned seed) {
  std::mt19937_64 engine(seed);
  const auto share = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const auto amplitude_K = [&] { return (share() < 0.5 ? -1.0 : 1.0) * (1.0 + 9.0 * share()); };
  Table spiked = temps_degC;
  for (Series& series : spiked) {
    int burst = 0;
    for (double& value : series) {
      if (burst == 0 && share() < 0.0005) burst = 2 + static_cast<int>(share() * 3.0);
      if (burst > 0) {
        --burst;
        value += amplitude_K();
      } else if (share() < 0.005) {
        value += amplitude_K();
      }
    }
  }
  return spiked;
}

/// The rows at which a method takes values.
std::vector<std::size_t> rows_at(const Series& time_s, double pitch_s) {
  std::vector<std::size_t> rows;
  double due_s = time_s.front();
  for (std::size_t row = 0; row < time_s.size(); ++row) {
    if (time_s[row] < due_s - 1e-6) continue;
    rows.push_back(row);
    while (due_s <= time_s[row] + 1e-6) due_s += pitch_s;
  }
  return rows;
}

/// Offsets of all outputs at `rows`, shape (outputs, rows): -P (T - T_ref), T smoothed.
Table offsets_um(const Data& data, const Table& temps_degC, const Method& method,
                 const std::vector<std::size_t>& rows) {
  Table offsets(data.matrix_um_per_K.size(), Series(rows.size(), 0.0));
  for (std::size_t sensor = 0; sensor < temps_degC.size(); ++sensor) {
    const Filter filter = method.make();
    const double reference_degC = data.temps_degC[sensor].front();
    double value_degC = reference_degC;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double measured_degC = temps_degC[sensor][rows[i]];
      if (std::isfinite(measured_degC))
        value_degC = filter({at_second(data.time_s[rows[i]]), measured_degC});
      for (std::size_t output = 0; output < offsets.size(); ++output)
        offsets[output][i] -= data.matrix_um_per_K[output][sensor] * (value_degC - reference_degC);
    }
  }
  return offsets;
}

double largest_step_um(const Table& offsets) {
  double largest_um = 0.0;
  for (const Series& series : offsets)
    for (std::size_t i = 1; i < series.size(); ++i)
      largest_um = std::max(largest_um, std::abs(series[i] - series[i - 1]));
  return largest_um;
}

double rms_um(const Table& offsets, const Table& truth) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t output = 0; output < offsets.size(); ++output)
    for (std::size_t i = 0; i < offsets[output].size(); ++i) {
      const double error_um = offsets[output][i] - truth[output][i];
      sum += error_um * error_um;
      ++count;
    }
  return std::sqrt(sum / static_cast<double>(count));
}

struct Result {
  double largest_step_um;  ///< with spikes; median over the seeds
  double rms_um;           ///< with spikes, relative to the offset from the unchanged data
  double unspiked_rms_um;  ///< the same without spikes
};

Result measure(const Data& data, const std::vector<Table>& spiked, const Method& method) {
  const auto rows = rows_at(data.time_s, method.pitch_s);
  const Table truth = offsets_um(data, data.temps_degC, methods(1.0).front(), rows);
  std::vector<double> steps;
  std::vector<double> errors;
  for (const Table& temps_degC : spiked) {
    const Table offsets = offsets_um(data, temps_degC, method, rows);
    steps.push_back(largest_step_um(offsets));
    errors.push_back(rms_um(offsets, truth));
  }
  return {median(steps), median(errors),
          rms_um(offsets_um(data, data.temps_degC, method, rows), truth)};
}

/// Largest lag [K] behind a temperature that rests for an hour, then continues as
/// `course_K(seconds)`.
double largest_lag_K(const Method& method, const std::function<double(double)>& course_K) {
  const Filter filter = method.make();
  double largest_K = 0.0;
  for (double time_s = -3600.0; time_s <= 3600.0; time_s += method.pitch_s) {
    const double truth_K = time_s > 0 ? course_K(time_s) : 0.0;
    largest_K =
        std::max(largest_K, std::abs(filter({at_second(time_s + 3600.0), truth_K}) - truth_K));
  }
  return largest_K;
}

/// Time [s] from a step of 5 K until the value stays within 0.5 K of it.
double step_followed_s(const Method& method) {
  const Filter filter = method.make();
  double wrong_until_s = 0.0;
  for (double time_s = -3600.0; time_s <= 3600.0; time_s += method.pitch_s) {
    const double truth_K = time_s > 0 ? 5.0 : 0.0;
    const double error_K = filter({at_second(time_s + 3600.0), truth_K}) - truth_K;
    if (!(std::abs(error_K) <= 0.5)) wrong_until_s = time_s;
  }
  return wrong_until_s;
}

void print_table(const std::map<std::string, Result>& results, double half_width_K) {
  std::printf("\nhalf-width %.2f K\n%-20s %7s %12s %10s %12s %12s %12s %10s\n", half_width_K,
              "method", "pitch s", "step um", "rms um", "unspiked um", "1 K/min K", "4 K/min K",
              "5 K step s");
  for (const Method& method : methods(half_width_K)) {
    const Result& result = results.at(method.name);
    const auto ramp = [&](double K_per_min) {
      return largest_lag_K(method, [K_per_min](double time_s) {
        return K_per_min / 60.0 * std::min(time_s, 900.0);
      });
    };
    std::printf("%-20s %7.0f %12.2f %10.3f %12.3f %12.2f %12.2f %10.0f\n", method.name.c_str(),
                method.pitch_s, result.largest_step_um, result.rms_um, result.unspiked_rms_um,
                ramp(1.0), ramp(4.0), step_followed_s(method));
  }
}

std::map<std::string, Result> compare(const Data& data, const std::vector<Table>& spiked,
                                      double half_width_K) {
  std::map<std::string, Result> results;
  for (const Method& method : methods(half_width_K))
    results[method.name] = measure(data, spiked, method);
  print_table(results, half_width_K);
  return results;
}

int run(const std::filesystem::path& folder) {
  const Data data = load(folder);
  std::vector<Table> spiked;
  for (unsigned seed = 1; seed <= seeds; ++seed)
    spiked.push_back(with_spikes(data.temps_degC, seed));
  std::printf(
      "%zu rows of 15 s, %zu sensors, %zu outputs; medians of %d seeds; n = %zu.\n"
      "step: largest change of an offset between two values in use; rms: against the offset "
      "from the\ndata as measured; unspiked: the same without spikes; K/min: largest lag "
      "behind a ramp of 15 min;\n5 K step: until the value stays within 0.5 K.\n",
      data.time_s.size(), data.temps_degC.size(), data.matrix_um_per_K.size(), seeds, window);
  for (const double half_width_K : {0.1, 0.2, 0.5, 1.0}) compare(data, spiked, half_width_K);
  const auto results = compare(data, spiked, SmoothingConfig{}.half_width_K);
  std::printf("\n");
  for (const Method& method : methods(1.0)) {
    const Result& result = results.at(method.name);
    std::printf("largest_step_%s %.3f um\n", method.name.c_str(), result.largest_step_um);
    std::printf("rms_error_%s %.4f um\n", method.name.c_str(), result.rms_um);
  }
  return 0;
}

}  // namespace
}  // namespace thermocomp

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: bench_smoothing FOLDER (of hours_00_32.csv, static_model.toml)\n");
    return 2;
  }
  try {
    return thermocomp::run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "smoothing: %s\n", error.what());
    return 2;
  }
}
