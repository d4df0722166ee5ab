// A gate machine by finite elements and by beam formulas, and three oil conditions with and without
// running correction. Fixed seeds give the same figures every time.
//
//   bench_gate_machine coefficients
//   bench_gate_machine run RUN.csv         the first condition measured once, for `thermocomp fit`
//   bench_gate_machine corrections MODEL   formulas' and the fitted model's, corrected or not
//   bench_gate_machine record              gains recorded on two conditions, evaluated on the third
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "cli/model/course_fit.hpp"
#include "config/model/model_file.hpp"
#include "config/runs/run_file.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/terms/low_pass.hpp"
#include "gate_structure.hpp"

namespace {

using namespace thermocomp;
using bench::GateStructure;
using bench::Oil;
using identification::TiedCoefficients;
using identification::TiedColumns;

constexpr double step_s = 10.0;
constexpr double temperature_noise_K = 0.0316;  // 0.1 K per reading, one per second, ten per step
constexpr double probing_noise_um = 0.3;
constexpr std::size_t probing_every_steps = 30;  // 5 min
constexpr double hours = 5.0;
constexpr double tie_mm = 250.0;
constexpr double tie_places = 10.0;
constexpr double fitted_filter_s = 10.0;

void compare_coefficients() {
  std::printf(
      "beam formulas and finite elements (config/examples/gate_structure.toml), um/K\n"
      "  l4 mm   l/l4   Ki beam    Ki fe   of Ki0     Kc beam    Kc fe\n");
  double worst_ki = 0.0;
  double worst_kc = 0.0;
  for (const double height_mm : {150.0, 250.0, 300.0, 400.0, 500.0, 600.0, 750.0, 900.0}) {
    const GateStructure gate(height_mm, step_s);
    const TiedColumns& m = gate.columns();
    const TiedCoefficients beam = identification::tied_coefficients(m);
    const TiedCoefficients fe = gate.coefficients();
    const double l1_mm = m.heated_height_mm;
    const double free_um_per_K = 1000 * m.column_expansion_per_K * l1_mm *
                                 (2 * m.working_height_mm - l1_mm) / (2 * m.column_width_mm);
    const double ki = (fe.ki_um_per_K - beam.ki_um_per_K) / free_um_per_K;
    const double kc = fe.kc_um_per_K[0] / beam.kc_um_per_K[0] - 1;
    worst_ki = std::max(worst_ki, std::abs(ki));
    worst_kc = std::max(worst_kc, std::abs(kc));
    std::printf("  %5.0f  %5.2f  %8.3f %8.3f  %+5.1f %%   %8.3f %8.3f  %+5.1f %%\n", height_mm,
                m.working_height_mm / height_mm, beam.ki_um_per_K, fe.ki_um_per_K, 100 * ki,
                beam.kc_um_per_K[0], fe.kc_um_per_K[0], 100 * kc);
  }
  std::printf("ki_difference_of_free_max %.4f ratio\nkc_difference_max %.4f ratio\n", worst_ki,
              worst_kc);
}

/// Oil on in odd hours and off in even ones, or by the third condition.
Oil oil_at(int condition, double hour) {
  Oil oil;
  oil.in_tank = condition == 3 ? hour < 3 || hour >= 4 : static_cast<int>(hour) % 2 == 0;
  if (condition == 2) oil.temp_degC = 40.0 - 20.0 * std::exp(-hour / 0.25);
  if (condition == 3 && hour >= 1 && hour < 2) oil.temp_degC = 20.0;
  return oil;
}

using Readings = std::array<double, 3>;  ///< A, B, mean of the tie [degC]
constexpr double room_degC = 20.0;

/// True course, and its noisy measurements.
struct Course {
  std::vector<double> um;
  std::vector<Readings> temps_degC;
};

Course course_of(int condition) {
  GateStructure gate(tie_mm, step_s);
  Course course;
  for (int step = 0; step < static_cast<int>(hours * 3600 / step_s); ++step) {
    if (step > 0) gate.advance(oil_at(condition, (step - 1) * step_s / 3600));
    course.um.push_back(gate.displacement_um());
    course.temps_degC.push_back(
        {room_degC + gate.theta_a_K(), room_degC + gate.theta_b_K(), room_degC + gate.theta_c_K()});
  }
  return course;
}

struct Measured {
  std::vector<Readings> temps_degC;  ///< low-pass filtered
  std::vector<double> probed_um;     ///< one per step; the used ones are selected later
};

nanoseconds time_of(std::size_t step) {
  return std::chrono::duration_cast<nanoseconds>(
      std::chrono::duration<double>(static_cast<double>(step) * step_s));
}

Measured measured(const Course& course, double filter_s, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise;
  std::array<LowPass, 3> filters{LowPass(filter_s), LowPass(filter_s), LowPass(filter_s)};
  Measured result;
  for (std::size_t step = 0; step < course.um.size(); ++step) {
    Readings readings = course.temps_degC[step];
    for (std::size_t i = 0; i < readings.size(); ++i) {
      const double share = i == 2 ? 1.0 / std::sqrt(tie_places) : 1.0;
      readings[i] += share * temperature_noise_K * noise(engine);
      readings[i] = filters[i].step(time_of(step), readings[i]);
    }
    result.temps_degC.push_back(readings);
    result.probed_um.push_back(course.um[step] + probing_noise_um * noise(engine));
  }
  return result;
}

struct Left {
  double low{0.0};
  double high{0.0};
  double later_peak{0.0};  ///< from the second probing on
  [[nodiscard]] double peak() const { return std::max(-low, high); }
};

/// Residual of the true displacement at any time.
Left residual(const Course& course, const Measured& readings, const CorrectionConfig& config,
              const ThermalModel& model, bool probed = true) {
  DisplacementModel displacement(model);
  RunningCorrection correction(config, model, 0);
  const Readings reference{room_degC, room_degC, room_degC};
  Left left;
  for (std::size_t i = 0; i < course.um.size(); ++i) {
    const Readings& temps = readings.temps_degC[i];
    Readings rise{};
    for (std::size_t k = 0; k < rise.size(); ++k) rise[k] = temps[k] - reference[k];
    double model_um = 0.0;
    displacement.step(time_of(i), temps, reference, {}, {&model_um, 1});
    correction.step(time_of(i), rise, true);
    const double um = course.um[i] - model_um - correction.correction_um();
    left.low = std::min(left.low, um);
    left.high = std::max(left.high, um);
    if (i > 2 * probing_every_steps) left.later_peak = std::max(left.later_peak, std::abs(um));
    if (probed && i > 0 && i % probing_every_steps == 0) {
      correction.measured({readings.probed_um[i], model_um});
    }
  }
  return left;
}

const std::vector<std::string> inputs{"a_degC", "b_degC", "c_degC"};

ThermalModel formula_model(double ki_share, double kc_share) {
  const TiedCoefficients k =
      identification::tied_coefficients(GateStructure(tie_mm, step_s).columns());
  const double ki = ki_share * k.ki_um_per_K;
  ThermalModel model;
  model.inputs = inputs;
  model.outputs = {"x_um"};
  model.matrix_um_per_K = {{ki, -ki, -kc_share * k.kc_um_per_K[0]}};
  return model;
}

CorrectionConfig two_phase(bool printed_form) {
  CorrectionConfig config;
  config.form = CorrectionForm::two_phase;
  config.groups = {{"a_degC", "b_degC"}, {"c_degC"}};
  if (printed_form) config.first_gain = FirstGain::eq_34;
  config.noise_um = probing_noise_um;
  config.turn_um = 1.5;
  return config;
}

/// Parameters of the recursive form.
struct Choice {
  double filter_s{0.0};
  CorrectionConfig correction;
};

CorrectionConfig recursive(bool sides_apart, double gain_drift, double bias_drift) {
  CorrectionConfig config = two_phase(false);
  config.form = CorrectionForm::recursive;
  if (sides_apart) config.groups = {{"a_degC"}, {"b_degC"}, {"c_degC"}};
  config.noise_um = 2 * probing_noise_um;  // noise of the probing plus that of the readings
  config.gain_drift_per_sqrt_h = gain_drift;
  config.bias_drift_um_per_sqrt_h = bias_drift;
  return config;
}

/// Chosen on the first condition alone, with other noise than in the tables.
Choice chosen_on(const Course& first, const std::array<const ThermalModel*, 2>& models) {
  Choice best;
  double least_um = std::numeric_limits<double>::infinity();
  for (const double filter_s : {5.0, 10.0, 15.0, 20.0, 30.0}) {
    std::vector<Measured> readings;
    for (const std::uint64_t seed : {101u, 102u, 103u}) {
      readings.push_back(measured(first, filter_s, seed));
    }
    for (const bool sides_apart : {false, true})
      for (const double gain_drift : {0.02, 0.05, 0.1, 0.2})
        for (const double bias_drift : {3.0, 6.0, 12.0, 24.0, 48.0}) {
          const CorrectionConfig config = recursive(sides_apart, gain_drift, bias_drift);
          double peak_um = 0.0;
          for (const ThermalModel* model : models) {
            double worst_um = 0.0;
            for (const Measured& each : readings)
              worst_um = std::max(worst_um, residual(first, each, config, *model).later_peak);
            peak_um += worst_um;
          }
          if (peak_um >= least_um) continue;
          least_um = peak_um;
          best = {filter_s, config};
        }
  }
  std::printf("chosen on condition 1: low pass %g s, %zu groups, gain drift %g, bias drift %g\n",
              best.filter_s, best.correction.groups.size(), best.correction.gain_drift_per_sqrt_h,
              best.correction.bias_drift_um_per_sqrt_h);
  return best;
}

struct Column {
  const char* name;
  const char* key;
  const ThermalModel* model;
  CorrectionConfig correction;
};

struct Peak {
  std::string name;
  double um{0.0};
};

/// @return the largest residual of each column over the three conditions
std::vector<Peak> table(const std::string& title, const std::array<Course, 3>& courses,
                        double filter_s, const std::vector<Column>& columns) {
  std::printf("%s: residual, um\n  condition  without       ", title.c_str());
  std::vector<Peak> peaks;
  for (const Column& column : columns) {
    std::printf("   %-15s", column.name);
    peaks.push_back({std::string(column.key).append("_peak"), 0.0});
  }
  std::printf("\n");
  for (std::size_t i = 0; i < courses.size(); ++i) {
    const Measured readings = measured(courses[i], filter_s, i + 1);
    const auto [low, high] = std::minmax_element(courses[i].um.begin(), courses[i].um.end());
    std::printf("  %zu        %+6.1f .. %+5.1f", i + 1, *low, *high);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const Left left = residual(courses[i], readings, columns[k].correction, *columns[k].model);
      peaks[k].um = std::max(peaks[k].um, left.peak());
      std::printf("  %+6.1f .. %+5.1f", left.low, left.high);
    }
    std::printf("\n");
  }
  return peaks;
}

void compare_corrections(const std::string& fitted_file) {
  const std::array<Course, 3> courses{course_of(1), course_of(2), course_of(3)};
  const ThermalModel wrong = formula_model(1.2, 0.8);
  const ThermalModel formula = formula_model(1.0, 1.0);
  const ThermalModel fitted = load_model(fitted_file);
  const Choice choice = chosen_on(courses[0], {&formula, &wrong});
  const auto columns = [&](const ThermalModel& model) -> std::vector<Column> {
    return {{"Ki, Kc", "ki_kc", &model, {}},
            {"Ri printed, Rc", "printed", &model, two_phase(true)},
            {"Ri, Rc", "two_phase", &model, two_phase(false)},
            {"recursive", "recursive", &model, choice.correction}};
  };
  table("Ki 20 % too large, Kc 20 % too small", courses, choice.filter_s, columns(wrong));
  std::vector<Peak> peaks =
      table("coefficients of the formulas", courses, choice.filter_s, columns(formula));
  const auto of_fitted = table("model fitted on condition 1", courses, fitted_filter_s,
                               {{"alone", "fitted", &fitted, {}},
                                {"recursive", "fitted_recursive", &fitted, choice.correction}});
  peaks.insert(peaks.end(), of_fitted.begin(), of_fitted.end());
  for (const Peak& peak : peaks) std::printf("%s %.2f um\n", peak.name.c_str(), peak.um);
}

/// Rows of an indicator and a logger, one per step.
std::string run_text(const Course& course, std::uint64_t seed) {
  const Measured readings = measured(course, fitted_filter_s, seed);
  std::string text = "time_s,a_degC,b_degC,c_degC,x_um\n";
  std::array<char, 128> line{};
  for (std::size_t i = 0; i < course.um.size(); ++i) {
    const Readings& temps = readings.temps_degC[i];
    std::snprintf(line.data(), line.size(), "%g,%.4f,%.4f,%.4f,%.3f\n",
                  static_cast<double>(i) * step_s, temps[0], temps[1], temps[2],
                  readings.probed_um[i]);
    text += line.data();
  }
  return text;
}

void write_run(const char* path) {
  std::FILE* file = std::fopen(path, "w");
  if (file == nullptr) throw std::runtime_error(std::string(path).append(": cannot be written"));
  std::fputs(run_text(course_of(1), 11).c_str(), file);
  std::fclose(file);
}

/// Without a correction, with the record of the other two conditions, with probings, and with both;
/// largest residual of the condition left out. Two sides in one group, as published.
void compare_record() {
  const std::array<Course, 3> courses{course_of(1), course_of(2), course_of(3)};
  const CorrectionConfig correction = recursive(false, 0.1, 0.0);
  CorrectionConfig off = correction;
  off.form = CorrectionForm::off;
  std::array<double, 4> peaks{};
  for (const auto& [ki_share, kc_share] : {std::pair{1.2, 0.8}, std::pair{1.0, 1.0}}) {
    ThermalModel model = formula_model(ki_share, kc_share);
    std::printf(
        "Ki times %g, Kc times %g: residual of the condition left out, um\n"
        "  condition  none              record            probings          both\n",
        ki_share, kc_share);
    for (std::size_t left_out = 0; left_out < courses.size(); ++left_out) {
      std::vector<RunFile> runs;
      for (std::size_t i = 0; i < courses.size(); ++i)
        if (i != left_out)
          runs.push_back(parse_run(run_text(courses[i], 20 + i), "condition " + std::to_string(i)));
      ThermalModel recorded = model;
      recorded.course =
          cli::fit_course(runs, model, correction, step_s * probing_every_steps).course;
      const Measured readings = measured(courses[left_out], fitted_filter_s, left_out + 1);
      const auto left = [&](const CorrectionConfig& config, const ThermalModel& by, bool probed) {
        return residual(courses[left_out], readings, config, by, probed);
      };
      const std::array<Left, 4> all{left(off, model, false), left(correction, recorded, false),
                                    left(correction, model, true),
                                    left(correction, recorded, true)};
      std::printf("  %zu        ", left_out + 1);
      for (std::size_t k = 0; k < all.size(); ++k) {
        std::printf("  %+6.1f .. %+5.1f", all[k].low, all[k].high);
        if (ki_share > 1.0) peaks[k] = std::max(peaks[k], all[k].peak());
      }
      std::printf("\n");
    }
  }
  std::printf(
      "left_out_none %.2f um\nleft_out_record %.2f um\nleft_out_probings %.2f um\n"
      "left_out_both %.2f um\n",
      peaks[0], peaks[1], peaks[2], peaks[3]);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::string what = argc > 1 ? argv[1] : "";
    if (what == "coefficients" && argc == 2)
      compare_coefficients();
    else if (what == "run" && argc == 3)
      write_run(argv[2]);
    else if (what == "corrections" && argc == 3)
      compare_corrections(argv[2]);
    else if (what == "record" && argc == 2)
      compare_record();
    else
      throw std::runtime_error("coefficients, run RUN.csv, corrections MODEL.toml or record");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_gate_machine: %s\n", error.what());
    return 2;
  }
  return 0;
}
