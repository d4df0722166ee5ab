// The cycle and its parts: timing, skipped cycles, hand-over.
#include "daemon/cycle/cycle.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <random>
#include <thread>
#include <time.h>
#include <unistd.h>
#include <vector>

#include <catch2/catch.hpp>
#include <sys/syscall.h>

#include "drivers/controllers/kinds/make_controller.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

std::atomic<bool> sleep_fails{false};

}  // namespace

/// Replaces the C library's, to fail as under a system call filter.
extern "C" int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  if (sleep_fails) return EPERM;
  return syscall(SYS_clock_nanosleep, clock, flags, time, left) == 0 ? 0 : errno;
}

namespace {

/// Called once per cycle; can be made slow, which a real source must not be.
class SlowSource final : public SensorSource {
 public:
  void start() override {}
  void stop() noexcept override {}
  [[nodiscard]] BusHealth health() const override { return {}; }
  void newest(std::span<Reading> all) noexcept override {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    all[0] = {20.0, now, Fault::none};
    if (stall_once.exchange(false)) std::this_thread::sleep_for(55ms);
    seen.fetch_add(1);
  }
  std::atomic<bool> stall_once{false};
  std::atomic<int> seen{0};
};

EstimatorConfig one_sensor() {
  EstimatorConfig config;
  config.sensors.push_back({"s", {}, std::nullopt, {}, {}});
  config.sensors.back().screening.settle_s = 0.0;
  config.blocks.push_back({"b", "b_degC", {0}});
  config.axes.push_back({"z", "z_um", 1.0, {}});
  config.compensation.enabled_at_first_start = true;
  return config;
}

ThermalModel one_input(double gain_um_per_K) {
  ThermalModel model;
  model.inputs = {"b_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{gain_um_per_K}};
  return model;
}

std::unique_ptr<CycleParts> parts(double gain_um_per_K) {
  return std::make_unique<CycleParts>(Estimator(one_sensor(), one_input(gain_um_per_K)));
}

/// A cycle of 10 ms on its own thread, ended with the scope.
struct RunningCycle {
  SlowSource source;
  DryRunController controller{{"none", 1}};
  Grid grid{std::chrono::steady_clock::now().time_since_epoch(), 10ms};
  Cycle cycle{grid, {&source}, controller, 1, parts(1.0)};
  std::thread thread;

  RunningCycle() {
    controller.start();
    thread = std::thread([this] { cycle.run(); });
  }
  ~RunningCycle() {
    cycle.stop();
    thread.join();
  }
  template <class Condition>
  bool eventually(Condition condition) {
    for (int i = 0; i < 10'000; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }
};

}  // namespace

TEST_CASE("a histogram's percentiles are within 1.6 percent of the samples'", "[histogram]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  std::mt19937 random(seed);
  std::lognormal_distribution<double> durations(10.0, 2.0);
  DurationHistogram histogram;
  std::vector<std::int64_t> samples(5000);
  for (auto& sample : samples) {
    sample = static_cast<std::int64_t>(durations(random));
    histogram.record(std::chrono::nanoseconds(sample));
  }
  std::sort(samples.begin(), samples.end());
  CHECK(histogram.count() == samples.size());
  CHECK(histogram.max().count() == samples.back());
  for (const double fraction : {0.01, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto index = static_cast<std::size_t>(std::ceil(fraction * 5000.0)) - 1;
    const auto exact = static_cast<double>(samples[index]);
    const auto found = static_cast<double>(histogram.percentile(fraction).count());
    CHECK(found >= exact);
    CHECK(found <= exact * (1.0 + 1.0 / 64) + 1.0);
  }
}

TEST_CASE("an empty histogram has no percentile and a negative duration counts as 0",
          "[histogram]") {
  DurationHistogram histogram;
  CHECK(histogram.percentile(0.99) == 0ns);
  histogram.record(-5ns);
  CHECK(histogram.count() == 1);
  CHECK(histogram.max() == 0ns);
  histogram.clear();
  CHECK(histogram.count() == 0);
}

TEST_CASE("the command queue keeps the order and refuses when full", "[cycle]") {
  CommandQueue queue;
  Command command;
  CHECK_FALSE(queue.try_pop(command));
  int taken = 0;
  while (queue.try_push({CommandKind::measured, 1, static_cast<double>(taken)})) ++taken;
  CHECK(taken == 64);
  for (int i = 0; i < taken; ++i) {
    REQUIRE(queue.try_pop(command));
    CHECK(command.value_um == i);
  }
  CHECK_FALSE(queue.try_pop(command));
}

TEST_CASE("cycles that were overrun are counted and the phase is kept", "[cycle]") {
  RunningCycle running;
  REQUIRE(running.eventually([&] { return running.source.seen.load() >= 5; }));
  running.source.stall_once.store(true);
  REQUIRE(running.eventually([&] { return running.cycle.timing().missed.load() >= 4; }));
  const int seen = running.source.seen.load();
  REQUIRE(running.eventually([&] { return running.source.seen.load() >= seen + 20; }));
  const Report& report = running.cycle.report();
  // Every step's time is on the grid, before and after.
  CHECK((report.now - running.grid.start) % running.grid.period == 0ns);
}

TEST_CASE("offsets recorded at the end precede the cycles skipped by then", "[cycle]") {
  DryRunController controller{{"none", 1}};
  const Grid grid{1h, 10ms};
  RecordRing ring{256};
  auto recorded = parts(1.0);
  recorded->recorder = std::make_unique<CycleRecorder>(ring, std::make_shared<RecordingSession>(),
                                                       grid, 1s, recorded->estimator);
  Cycle cycle{grid, {}, controller, 1, std::move(recorded)};
  REQUIRE(cycle.begin(grid.start) == 0);
  CHECK_FALSE(cycle.finish_recording());  // a daemon ended during its start
  cycle.step(0);
  cycle.step(1);
  REQUIRE(cycle.next_after(1, grid.time_of(5)) == 5);
  const bool goes_on = GENERATE(false, true);
  if (goes_on) cycle.step(5);
  CHECK(cycle.finish_recording() == (goes_on ? 5 : 1));

  std::array<Record, 256> records{};
  const std::size_t count = ring.pop(records);
  std::vector<std::uint64_t> skipped;
  std::uint64_t newest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    CHECK(records[i].cycle >= newest);
    newest = records[i].cycle;
    if (records[i].kind == RecordKind::skipped) skipped.push_back(records[i].cycle);
  }
  CHECK(newest == (goes_on ? 5 : 1));
  CHECK(skipped == (goes_on ? std::vector<std::uint64_t>{2} : std::vector<std::uint64_t>{}));
}

TEST_CASE("parts handed over replace the old ones in one step, without a jump", "[cycle]") {
  RunningCycle running;
  REQUIRE(running.eventually([&] { return running.cycle.report().cycle > 0; }));
  REQUIRE(running.cycle.send({CommandKind::disable, 0, 0.0}));
  REQUIRE(running.eventually([&] { return running.cycle.report().mode == Mode::disabled; }));
  auto next = parts(2.0);
  next->estimator.plan_adoption(running.cycle.parts().estimator);
  running.cycle.hand_over(std::move(next));
  std::unique_ptr<CycleParts> retired;
  REQUIRE(running.eventually([&] { return (retired = running.cycle.take_retired()) != nullptr; }));
  CHECK(retired->estimator.model().matrix_um_per_K[0][0] == 1.0);
  CHECK(running.cycle.parts().estimator.model().matrix_um_per_K[0][0] == 2.0);
  // Switch and reference belong to the machine, not to the configuration.
  CHECK(running.cycle.report().mode == Mode::disabled);
  CHECK(running.cycle.report().inputs[0].reference_degC == 20.0);
}

namespace {

/// A machine that warms up with every step; stepped by the test.
struct WarmingMachine {
  class Source final : public SensorSource {
   public:
    void start() override {}
    void stop() noexcept override {}
    [[nodiscard]] BusHealth health() const override { return {}; }
    void newest(std::span<Reading> all) noexcept override {
      all[0] = {temp_degC += rise_K, now, Fault::none};
    }
    double rise_K{0.0};
    double temp_degC{20.0};
    nanoseconds now{};
  };
  explicit WarmingMachine(std::unique_ptr<CycleParts> made, nanoseconds pitch = 2h,
                          double rise_K = 0.125)
      : grid{1h, pitch}, cycle(grid, {&source}, controller, 1, std::move(made)) {
    source.rise_K = rise_K;
    controller.start();
    next = cycle.begin(grid.start);
  }
  /// @return the offset [um]
  double step(int count = 1) {
    for (; count > 0; --count) {
      source.now = grid.time_of(next);
      cycle.step(next++);
    }
    return cycle.report().axes[0].offset_um;
  }
  /// A probing of the total displacement: 2 um/K.
  void probe() {
    REQUIRE(cycle.send({CommandKind::measured, 0, 2.0 * (source.temp_degC - 20.125)}));
    step();
  }
  Source source;
  DryRunController controller{{"none", 1}};
  Grid grid;
  Cycle cycle;
  std::uint64_t next{0};
};

/// Three quarters of its effect are lagged.
ThermalModel late_input() {
  ThermalModel model = one_input(2.0);
  model.terms.push_back(
      {"thermal_lag", "b_degC", {{"tau_s", 14400.0}}, {{"gain_um_per_K", {{"z_um", 1.5}}}}});
  return model;
}

std::unique_ptr<CycleParts> contested(const ThermalModel& model, const ThermalModel& candidate,
                                      double pair = 1.0) {
  EstimatorConfig config = one_sensor();
  config.correction.measured = MeasuredMeaning::total;
  config.sensors[0].smoothing.form = SmoothingForm::off;
  config.blocks.push_back({"other", "other_degC", {0}});
  auto made = std::make_unique<CycleParts>(Estimator(config, model));
  made->candidate = std::make_unique<Candidate>(config, candidate, pair);
  return made;
}

std::unique_ptr<CycleParts> contested(double gain, double candidate_gain, double pair = 1.0) {
  return contested(one_input(gain), one_input(candidate_gain), pair);
}

double better(CycleParts& parts) {
  return ModelContest::chances(parts.candidate->score()).better;
}

}  // namespace

TEST_CASE("a candidate does not change any bit of the sent offsets", "[cycle][candidate]") {
  auto without = contested(1.0, 2.0);
  without->candidate.reset();
  WarmingMachine alone(std::move(without), 100ms, 0.001);
  WarmingMachine beside(contested(1.0, 2.0), 100ms, 0.001);
  for (int i = 0; i < 4000; ++i) {
    const double expected_um = alone.step();
    REQUIRE(beside.step() == expected_um);
    if (i % 100 != 99) continue;
    alone.probe();
    beside.probe();
  }
  CHECK(alone.step() < -3.0);
  CHECK(beside.cycle.parts().candidate->score()[0].probings == 40.0);
}

TEST_CASE("each probing scores model and candidate", "[cycle][candidate]") {
  WarmingMachine machine(contested(1.0, 1.9));
  for (int i = 0; i < 20; ++i) {
    machine.step(2);
    machine.probe();
  }
  const ModelContest::AxisScore score = machine.cycle.parts().candidate->score()[0];
  CHECK(score.probings == 20.0);
  // Errors of 1 and 0.1 um/K, at the same temperatures.
  CHECK(score.model_um2 == Approx(100.0 * score.candidate_um2));
  CHECK(better(machine.cycle.parts()) > 0.99);
}

TEST_CASE("a score survives restart and reload, for its two models only", "[cycle][candidate]") {
  WarmingMachine machine(contested(1.0, 2.0));
  for (int i = 0; i < 8; ++i) {
    machine.step(2);
    machine.probe();
  }
  CycleParts& first = machine.cycle.parts();
  const double message = better(first);
  REQUIRE(message > 0.5);
  PersistentState state = first.estimator.persistent_state(machine.cycle.report());
  first.candidate->add_to(state.correction);

  const double pair = GENERATE(1.0, 2.0);
  const double expected = pair == 1.0 ? message : 0.25;
  const auto restarted = contested(1.0, 2.0, pair);
  restarted->candidate->restore(state);
  CHECK(better(*restarted) == Approx(expected));

  auto reloaded = contested(1.0, 2.0, pair);
  reloaded->estimator.plan_adoption(first.estimator);
  reloaded->candidate->plan_adoption(first.estimator);
  machine.cycle.hand_over(std::move(reloaded));
  machine.step();
  REQUIRE(machine.cycle.take_retired() != nullptr);
  CHECK(better(machine.cycle.parts()) == Approx(expected));
  // It has the machine's reference: its errors stay 0.
  machine.probe();
  CHECK(machine.cycle.parts().candidate->score()[0].candidate_um2 == Approx(0.0).margin(1e-9));
}

TEST_CASE("a promoted candidate keeps the state of its lags and inputs", "[cycle][candidate]") {
  const bool promotes = GENERATE(true, false);
  ThermalModel other_input = one_input(2.0);
  other_input.inputs = {"other_degC"};
  const ThermalModel candidate = GENERATE_COPY(late_input(), other_input);
  WarmingMachine always(contested(candidate, one_input(2.0)));
  WarmingMachine machine(contested(one_input(2.0), candidate));
  always.step(20);
  machine.step(20);
  auto promoted = contested(candidate, one_input(2.0));
  promoted->promotes = promotes;
  promoted->estimator.plan_adoption(machine.cycle.parts().estimator);
  promoted->candidate->plan_adoption(machine.cycle.parts().estimator);
  machine.cycle.hand_over(std::move(promoted));
  always.step();
  machine.step();
  REQUIRE(machine.cycle.take_retired() != nullptr);
  const double expected_um = always.cycle.report().axes[0].displacement_um;
  const double displacement_um = machine.cycle.report().axes[0].displacement_um;
  CHECK((displacement_um == Approx(expected_um)) == promotes);
}

TEST_CASE("a failed sleep is counted, and no cycle runs ahead of time", "[cycle]") {
  RunningCycle running;
  REQUIRE(running.eventually([&] { return running.source.seen > 3; }));
  CHECK(running.cycle.timing().failed_sleeps == 0);
  sleep_fails = true;
  const auto began = std::chrono::steady_clock::now();
  const int seen = running.source.seen;
  running.eventually([&] { return running.source.seen >= seen + 20; });
  const auto took = std::chrono::steady_clock::now() - began;
  sleep_fails = false;
  CHECK(took > 180ms);  // one more cycle may have been under way
  CHECK(running.cycle.timing().failed_sleeps > 10);
}
