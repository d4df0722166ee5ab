// A gate machine as finite elements beside the beam formulas, and three oil conditions with and
// without running correction. The seeds are fixed: the same figures every time.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "estimator/running_correction.hpp"
#include "gate_fe.hpp"

namespace {

using namespace thermocomp;
using bench::GateFe;
using identification::GateMachine;
using identification::TieCoefficients;

constexpr double depth_mm = 60.0;
constexpr double step_s = 10.0;
constexpr double temperature_noise_K = 0.0316;  // 0.1 K a reading, one a second, ten in a step
constexpr double probing_noise_um = 0.3;
constexpr std::size_t smoothed_steps = 2;  // in a mean: 20 s
constexpr int probing_every_steps = 30;    // 5 min
constexpr double hours = 5.0;

GateMachine machine() {
  GateMachine m;
  m.working_height_mm = 600;
  m.heated_height_mm = 300;
  m.tie_height_mm = 250;
  m.column_width_mm = 80;
  m.tie_length_mm = 400;
  m.column_inertia_mm4 = depth_mm * 80 * 80 * 80 / 12;
  m.column_modulus_MPa = m.tie_modulus_MPa = 206000;
  m.column_expansion_per_K = m.tie_expansion_per_K = 11.5e-6;
  m.tie_area_mm2 = 150;
  return m;
}

void compare_coefficients() {
  std::printf(
      "beam formulas and finite elements (plane stress), um/K\n"
      "  l4 mm   l/l4   Ki beam    Ki fe   of Ki0     Kc beam    Kc fe\n");
  double worst_ki = 0.0;
  double worst_kc = 0.0;
  for (const double tie_mm : {150.0, 250.0, 300.0, 400.0, 500.0, 600.0, 750.0, 900.0}) {
    GateMachine m = machine();
    m.tie_height_mm = tie_mm;
    const TieCoefficients beam = identification::tie_coefficients(m);
    const TieCoefficients fe = GateFe(m, depth_mm).coefficients();
    const double free_um_per_K = 1000 * 3 * m.column_expansion_per_K * 600 * 600 / (8 * 80);
    const double ki = (fe.ki_um_per_K - beam.ki_um_per_K) / free_um_per_K;
    const double kc = fe.kc_um_per_K / beam.kc_um_per_K - 1;
    worst_ki = std::max(worst_ki, std::abs(ki));
    worst_kc = std::max(worst_kc, std::abs(kc));
    std::printf("  %5.0f  %5.2f  %8.3f %8.3f  %+5.1f %%   %8.3f %8.3f  %+5.1f %%\n", tie_mm,
                600 / tie_mm, beam.ki_um_per_K, fe.ki_um_per_K, 100 * ki, beam.kc_um_per_K,
                fe.kc_um_per_K, 100 * kc);
  }
  std::printf("ki_difference_of_free_max %.4f ratio\nkc_difference_max %.4f ratio\n", worst_ki,
              worst_kc);
}

/// Oil on for odd hours and off for even ones, or as the third condition has it.
bench::Surroundings oil_at(int condition, double hour) {
  const bool on = condition == 3 ? hour < 3 || hour >= 4 : static_cast<int>(hour) % 2 == 0;
  bench::Surroundings around;
  around.oil_W_per_m2K = on ? 300.0 : 0.0;
  around.oil_degC = 40.0;
  if (condition == 2) around.oil_degC = 40.0 - 20.0 * std::exp(-hour / 0.25);
  if (condition == 3 && hour >= 1 && hour < 2) around.oil_degC = 20.0;
  return around;
}

struct Course {
  std::vector<double> a, b, c, um;             // true
  std::vector<double> read_a, read_b, read_c;  // noisy, mean of 20 s
  std::vector<double> probed_um;               // noisy
};

Course course_of(int condition) {
  GateFe gate(machine(), depth_mm);
  std::mt19937_64 engine(static_cast<std::uint64_t>(condition));
  std::normal_distribution<double> noise;
  Course course;
  std::deque<std::array<double, 3>> last;
  for (int step = 0; step < static_cast<int>(hours * 3600 / step_s); ++step) {
    if (step > 0) gate.advance(oil_at(condition, (step - 1) * step_s / 3600), step_s);
    course.a.push_back(gate.theta_a_K());
    course.b.push_back(gate.theta_b_K());
    course.c.push_back(gate.theta_c_K());
    course.um.push_back(gate.displacement_um());
    double tie_K = 0.0;
    for (int i = 0; i < 10; ++i) tie_K += course.c.back() + temperature_noise_K * noise(engine);
    last.push_back({course.a.back() + temperature_noise_K * noise(engine),
                    course.b.back() + temperature_noise_K * noise(engine), tie_K / 10});
    if (last.size() > smoothed_steps) last.pop_front();
    std::array<double, 3> mean{};
    for (const auto& each : last)
      for (std::size_t i = 0; i < 3; ++i) mean[i] += each[i] / static_cast<double>(last.size());
    course.read_a.push_back(mean[0]);
    course.read_b.push_back(mean[1]);
    course.read_c.push_back(mean[2]);
    course.probed_um.push_back(course.um.back() + probing_noise_um * noise(engine));
  }
  return course;
}

struct Left {
  double low{0.0};
  double high{0.0};
  [[nodiscard]] double peak() const { return std::max(-low, high); }
};

/// What is left of the true displacement at any time.
Left residual(const Course& course, const CorrectionConfig& config, const TieCoefficients& k) {
  ThermalModel model;
  model.inputs = {"ta_degC", "tb_degC", "tc_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{k.ki_um_per_K, -k.ki_um_per_K, -k.kc_um_per_K}};
  RunningCorrection correction(config, model, 0);
  Left left;
  for (std::size_t i = 0; i < course.um.size(); ++i) {
    const std::vector<double> rise{course.read_a[i], course.read_b[i], course.read_c[i]};
    const double model_um = k.ki_um_per_K * (rise[0] - rise[1]) - k.kc_um_per_K * rise[2];
    const auto now = std::chrono::duration_cast<nanoseconds>(
        std::chrono::duration<double>(static_cast<double>(i) * step_s));
    correction.step(now, rise, true);
    const double um = course.um[i] - model_um - correction.correction_um();
    left.low = std::min(left.low, um);
    left.high = std::max(left.high, um);
    if (i > 0 && i % probing_every_steps == 0) correction.measured(course.probed_um[i], model_um);
  }
  return left;
}

CorrectionConfig two_phase(bool printed_form) {
  CorrectionConfig config;
  config.form = CorrectionForm::two_phase;
  config.groups = {{"ta_degC", "tb_degC"}, {"tc_degC"}};
  config.as_printed = printed_form;
  config.noise_um = probing_noise_um;
  config.turn_um = 1.5;
  return config;
}

CorrectionConfig recursive() {
  CorrectionConfig config = two_phase(false);
  config.form = CorrectionForm::recursive;
  config.noise_um = 0.6;  // of the probing and of the readings beside it
  config.gain_drift_per_sqrt_h = 0.2;
  config.bias_drift_um_per_sqrt_h = 12.0;
  return config;
}

/// @param ki_share, kc_share  of the formulas' coefficients: 1, or what somebody measured wrongly
void compare_corrections(double ki_share, double kc_share, const char* name) {
  std::printf("%s coefficients, three oil conditions of 5 h, probed every 5 min: residual, um\n",
              name);
  std::printf(
      "  condition  none             Ki, Kc           Ri printed, Rc   Ri, Rc           "
      "recursive\n");
  TieCoefficients k = identification::tie_coefficients(machine());
  k.ki_um_per_K *= ki_share;
  k.kc_um_per_K *= kc_share;
  Left worst_two;
  Left worst_recursive;
  for (int condition = 1; condition <= 3; ++condition) {
    const Course course = course_of(condition);
    const auto [low, high] = std::minmax_element(course.um.begin(), course.um.end());
    const Left alone = residual(course, CorrectionConfig{}, k);
    const Left printed_form = residual(course, two_phase(true), k);
    const Left two = residual(course, two_phase(false), k);
    const Left general = residual(course, recursive(), k);
    std::printf("  %d      ", condition);
    for (const Left& left : {Left{*low, *high}, alone, printed_form, two, general})
      std::printf("  %+6.1f .. %+5.1f", left.low, left.high);
    std::printf("\n");
    if (two.peak() > worst_two.peak()) worst_two = two;
    if (general.peak() > worst_recursive.peak()) worst_recursive = general;
  }
  std::printf("two_phase_peak_%s %.2f um\nrecursive_peak_%s %.2f um\n", name, worst_two.peak(),
              name, worst_recursive.peak());
}

}  // namespace

int main() {
  compare_coefficients();
  compare_corrections(1.2, 0.8, "wrong");
  compare_corrections(1.0, 1.0, "formula");
  return 0;
}
