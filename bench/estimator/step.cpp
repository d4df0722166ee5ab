/// One step of the estimator compared with the bare matrix-vector product of the same size: 64
/// sensors, 32 blocks of two, 6 axes, each with a guideway of 16 positions (96 rows of 32).
///
/// `step` prints the ratio of the two times, measured alternately in one run. `step --count N` only
/// makes N steps, for an instruction counter; `--count-all-due N` the same with every value due for
/// smoothing, `--count-beside N` with a candidate of the same size. All readings are new at every
/// step. step_over_gemv: with the default smoothing, whose values are due once a minute;
/// step_all_due_over_gemv: every value is due at every step, 64 line fits.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "daemon/cycle/candidate.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t sensors_count = 64;
constexpr std::size_t blocks_count = 32;
constexpr std::size_t axes_count = 6;
constexpr std::size_t positions_count = 16;
constexpr nanoseconds cycle = std::chrono::milliseconds(1);

std::string numbered(const char* name, std::size_t number, const char* unit = "") {
  std::string text = name;
  text += std::to_string(number);
  text += unit;
  return text;
}

EstimatorConfig machine_config(double smoothing_period_s) {
  EstimatorConfig config;
  for (std::size_t i = 0; i < sensors_count; ++i) {
    SensorConfig sensor;
    sensor.name = numbered("s", i);
    sensor.smoothing.period_s = smoothing_period_s;
    sensor.screening.settle_s = 0.0;
    config.sensors.push_back(sensor);
  }
  for (std::size_t i = 0; i < blocks_count; ++i)
    config.blocks.push_back({numbered("b", i), numbered("t", i, "_degC"), {2 * i, 2 * i + 1}});
  for (std::size_t i = 0; i < axes_count; ++i) {
    config.signals.push_back(numbered("p", i, "_mm"));
    config.axes.push_back({numbered("a", i), numbered("o", i, "_um"), 1.0, {}});
  }
  config.compensation.enabled_at_first_start = true;
  return config;
}

/// All blocks with five low passes, as in `fit` of a whole record: 160 states, 6 outputs.
TermSpec lag_bank(const ThermalModel& model) {
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = model.inputs;
  term.bank.taus_s = {0.0, 300.0, 900.0, 2700.0, 8100.0};
  for (const std::string& output : model.outputs)
    term.bank.gain_um_per_unit[output].assign(model.inputs.size(), {0.0, 0.1, -0.2, 0.3, 0.1});
  return term;
}

/// Blocks that mostly move together.
void add_covariance(ThermalModel& model) {
  for (std::size_t i = 0; i < blocks_count; ++i)
    model.covariance_K2.emplace_back(blocks_count, 4.0)[i] += 0.04;
}

ThermalModel machine_model(bool with_bank) {
  ThermalModel model;
  for (std::size_t i = 0; i < blocks_count; ++i) model.inputs.push_back(numbered("t", i, "_degC"));
  const auto row = [](std::size_t seed) {
    std::vector<double> values;
    for (std::size_t j = 0; j < blocks_count; ++j)
      values.push_back(std::sin(static_cast<double>(seed * blocks_count + j)));
    return values;
  };
  for (std::size_t i = 0; i < axes_count; ++i) {
    model.outputs.push_back(numbered("o", i, "_um"));
    model.matrix_um_per_K.push_back(row(i));
    GuidewaySpec guideway{numbered("g", i), numbered("p", i, "_mm"), {}, {}};
    for (std::size_t k = 0; k < positions_count; ++k) {
      guideway.positions_mm.push_back(50.0 * static_cast<double>(k));
      guideway.rows_um_per_K[model.outputs[i]].push_back(row(100 + positions_count * i + k));
    }
    model.guideways.push_back(guideway);
  }
  if (with_bank) model.terms.push_back(lag_bank(model));
  return model;
}

/// The estimator's environment: new readings at every step, a controller that applies at once,
/// moving saddles.
class Machine {
 public:
  explicit Machine(double smoothing_period_s, bool with_bank = false)
      : estimator_(machine_config(smoothing_period_s), machine_model(with_bank)),
        readings_(sensors_count) {
    controller_.link_epoch = 1;
    controller_.online = true;
    controller_.written = controller_.online;
    controller_.applied_um.fill(0.0);
  }

  Machine(const EstimatorConfig& config, const ThermalModel& model)
      : estimator_(config, model), readings_(sensors_count) {
    controller_.link_epoch = 1;
    controller_.online = true;
    controller_.written = controller_.online;
    controller_.applied_um.fill(0.0);
  }

  void prepare(nanoseconds later = cycle) {
    now_ += later;
    ++steps_;
    const double time_s = 1e-9 * static_cast<double>(now_.count());
    for (std::size_t i = 0; i < sensors_count; ++i) {
      // Always inside the band: a slow change with noise of the last digit.
      const double noise_K = 1e-3 * static_cast<double>((steps_ * 7 + i * 13) % 11);
      readings_[i] = {20.0 + 0.01 * time_s + noise_K, now_, Fault::none};
    }
    controller_.taken_at = now_;
    for (std::size_t i = 0; i < axes_count; ++i) {
      controller_.applied_um[i] = command_.offset_um[i];
      controller_.signals[i] = 375.0 + 370.0 * std::sin(0.7 * time_s + static_cast<double>(i));
    }
  }
  [[gnu::noinline]] void step() {
    estimator_.step(now_, readings_, controller_, command_);
    if (candidate_) candidate_->step(now_, readings_, controller_);
  }
  void let_run_beside() { candidate_.emplace(estimator_.config(), estimator_.model(), 1.0); }
  [[nodiscard]] Mode mode() const { return estimator_.make_report().mode; }
  [[nodiscard]] double offset_um() const { return command_.offset_um[0]; }

 private:
  Estimator estimator_;
  std::optional<Candidate> candidate_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
  nanoseconds now_{};
  std::size_t steps_{0};
};

/// Median duration of a step without sensor check, and the additional duration of steps with the
/// check (once a minute). Needs a covariance.
struct Judging {
  double step_ns{0.0};
  double minute_us{0.0};
};

/// Product of all rows at all positions with the blocks' temperatures, by Eigen.
class Product {
 public:
  Product()
      : matrix_(Matrix::Random(axes_count * positions_count, blocks_count)),
        rise_K_(Eigen::VectorXd::Random(blocks_count)),
        out_um_(axes_count * positions_count) {}
  [[gnu::noinline]] void step() { out_um_.noalias() = matrix_ * rise_K_; }
  void prepare() { rise_K_[0] = 1e-3 + out_um_[0] * 1e-9; }

 private:
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Matrix matrix_;
  Eigen::VectorXd rise_K_;
  Eigen::VectorXd out_um_;
};

double now_ns() {
  return static_cast<double>(std::chrono::steady_clock::now().time_since_epoch().count());
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Duration of one step() [ns], without prepare() and less the cost of reading the clock.
template <class Subject>
double one_step_ns(Subject& subject, double clock_ns) {
  subject.prepare();
  const double start = now_ns();
  subject.step();
  return now_ns() - start - clock_ns;
}

double clock_cost_ns() {
  std::vector<double> costs;
  for (int i = 0; i < 10001; ++i) {
    const double start = now_ns();
    costs.push_back(now_ns() - start);
  }
  return median(costs);
}

struct Comparison {
  double step_ns;
  double product_ns;
  double ratio;  ///< median of the rounds' ratios
};

/// Alternating rounds of many steps; compares the medians of each round.
Comparison compare(double smoothing_period_s, bool with_bank = false) {
  constexpr int rounds = 101;
  constexpr int steps_of_a_round = 200;
  Machine machine(smoothing_period_s, with_bank);
  Product product;
  const double clock_ns = clock_cost_ns();
  std::vector<double> steps_ns;
  std::vector<double> products_ns;
  std::vector<double> ratios;
  for (int round = 0; round < rounds; ++round) {
    std::vector<double> step_ns;
    std::vector<double> product_ns;
    step_ns.reserve(steps_of_a_round);
    product_ns.reserve(steps_of_a_round);
    for (int i = 0; i < steps_of_a_round; ++i) step_ns.push_back(one_step_ns(machine, clock_ns));
    for (int i = 0; i < steps_of_a_round; ++i) product_ns.push_back(one_step_ns(product, clock_ns));
    steps_ns.push_back(median(step_ns));
    products_ns.push_back(median(product_ns));
    ratios.push_back(steps_ns.back() / products_ns.back());
  }
  if (machine.mode() != Mode::compensating) {
    std::fprintf(stderr, "step: the machine did not compensate; nothing was measured\n");
    std::exit(1);
  }
  return {median(steps_ns), median(products_ns), median(ratios)};
}

Judging measure_judging() {
  const double clock_ns = clock_cost_ns();
  ThermalModel model = machine_model(false);
  add_covariance(model);
  EstimatorConfig config = machine_config(SmoothingConfig{}.period_s);
  std::vector<double> steps_ns;
  std::vector<double> looks_ns;
  std::vector<double> minutes_ns;
  for (const bool judges : {true, false}) {
    if (!judges) config.compensation.suspected_sensors = SuspectedPolicy::off;
    Machine machine(config, model);
    for (int i = 0; judges && i < 20'000; ++i) steps_ns.push_back(one_step_ns(machine, clock_ns));
    // Once a minute, for more than 12 h, so that all ages have levels.
    for (int i = 0; i < 2000; ++i) {
      machine.prepare(std::chrono::seconds(60));
      const double start = now_ns();
      machine.step();
      (judges ? minutes_ns : looks_ns).push_back(now_ns() - start);
    }
  }
  return {median(steps_ns), 1e-3 * (median(minutes_ns) - median(looks_ns))};
}

int count_steps(int steps, double period_s, bool beside = false) {
  Machine machine(period_s);
  if (beside) machine.let_run_beside();
  for (int i = 0; i < steps; ++i) {
    machine.prepare();
    machine.step();
  }
  std::fprintf(stderr, "%d steps, offset %.6f um\n", steps, machine.offset_um());
  return machine.mode() == Mode::compensating ? 0 : 1;
}

int run() {
  std::printf(
      "64 sensors (all readings new at every step), 32 blocks of 2 sensors, 6 axes, each "
      "with a guideway\nof 16 positions; product: Eigen, 96 x 32, double, same flags.\n");
  const Comparison usual = compare(SmoothingConfig{}.period_s);
  std::printf(
      "default smoothing (one value a minute, none due in most cycles): step %.0f ns, product %.0f "
      "ns, "
      "ratio %.2f\n",
      usual.step_ns, usual.product_ns, usual.ratio);
  const Comparison all_due = compare(0.0);
  std::printf(
      "all 64 values due for smoothing (sliding line, n = 6): step %.0f ns, product %.0f "
      "ns, ratio %.2f\n",
      all_due.step_ns, all_due.product_ns, all_due.ratio);
  const Comparison bank = compare(SmoothingConfig{}.period_s, true);
  std::printf("with a bank of lags (32 temperatures, 5 time constants): step %.0f ns\n",
              bank.step_ns);
  const Judging judging = measure_judging();
  std::printf(
      "with a covariance, sensors judged once a minute: step %.0f ns, in that of the minute %.1f "
      "us "
      "more\n",
      judging.step_ns, judging.minute_us);
  std::printf("step_judging_ns %.0f ns\n", judging.step_ns);
  std::printf("step_judging_minute %.1f us\n", judging.minute_us);
  std::printf("step_lag_bank_ns %.0f ns\n", bank.step_ns);
  std::printf("step_lag_bank_over_plain %.3f ratio\n", bank.ratio / usual.ratio);
  std::printf("step_all_due_ns %.0f ns\n", all_due.step_ns);
  std::printf("step_all_due_over_gemv %.3f ratio\n", all_due.ratio);
  std::printf("step_ns %.0f ns\n", usual.step_ns);
  std::printf("step_over_gemv %.3f ratio\n", usual.ratio);
  return 0;
}

}  // namespace
}  // namespace thermocomp

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[1]) == "--count")
    return thermocomp::count_steps(std::atoi(argv[2]), thermocomp::SmoothingConfig{}.period_s);
  if (argc == 3 && std::string_view(argv[1]) == "--count-all-due")
    return thermocomp::count_steps(std::atoi(argv[2]), 0.0);
  if (argc == 3 && std::string_view(argv[1]) == "--count-beside")
    return thermocomp::count_steps(std::atoi(argv[2]), thermocomp::SmoothingConfig{}.period_s,
                                   true);
  if (argc == 1) return thermocomp::run();
  std::fprintf(stderr, "usage: step [--count N | --count-all-due N | --count-beside N]\n");
  return 2;
}
