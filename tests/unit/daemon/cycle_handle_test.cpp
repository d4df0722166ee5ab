// CycleHandle, with cycle and clock advanced by the test.
#include "daemon/cycle/cycle_handle.hpp"

#include <vector>

#include <catch2/catch.hpp>

#include "drivers/controllers/kinds/make_controller.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

class SteadySource final : public SensorSource {
 public:
  void start() override {}
  void stop() noexcept override {}
  [[nodiscard]] BusHealth health() const override { return {}; }
  void newest(std::span<Reading> all) noexcept override { all[0] = {20.0, now, Fault::none}; }
  nanoseconds now{};
};

EstimatorConfig machine(const std::vector<std::string>& axes) {
  EstimatorConfig config;
  config.sensors.push_back({"s", {}, std::nullopt, {}, {}});
  config.sensors.back().screening.settle_s = 0.0;
  config.blocks.push_back({"b", "b_degC", {0}});
  for (const std::string& name : axes) config.axes.push_back({name, name + "_um", 1.0, {}});
  config.compensation.enabled_at_first_start = true;
  return config;
}

ThermalModel model(const std::vector<std::string>& axes, double gain_um_per_K) {
  ThermalModel model;
  model.inputs = {"b_degC"};
  for (const std::string& name : axes) {
    model.outputs.push_back(name + "_um");
    model.matrix_um_per_K.push_back({gain_um_per_K});
  }
  return model;
}

/// A cycle of 10 ms, stepped by the test.
struct SteppedCycle {
  explicit SteppedCycle(const std::vector<std::string>& axes = {"z"})
      : controller({"none", axes.size()}),
        cycle(grid, {&source}, controller, 1, parts(1.0, axes)),
        next(cycle.begin(grid.start)) {
    step();
  }
  static std::unique_ptr<CycleParts> parts(double gain, const std::vector<std::string>& axes) {
    return std::make_unique<CycleParts>(Estimator(machine(axes), model(axes, gain)));
  }
  std::unique_ptr<CycleParts> next_parts(double gain,
                                         const std::vector<std::string>& axes = {"z"}) {
    auto made = parts(gain, axes);
    made->estimator.plan_adoption(cycle.parts().estimator);
    return made;
  }
  void step() {
    source.now = grid.time_of(next);
    cycle.step(next);
    next = cycle.next_after(next, grid.time_of(next));
  }
  [[nodiscard]] double gain() { return cycle.parts().estimator.model().matrix_um_per_K[0][0]; }

  SteadySource source;
  DryRunController controller;
  Grid grid{1h, 10ms};
  Cycle cycle;
  std::uint64_t next;
  std::vector<Command> done;
  CycleHandle handle{cycle, [this](const Command& command) { done.push_back(command); }};
  CycleHandle::Clock::time_point now{1h};
};

constexpr Command disable{CommandKind::disable, 0, 0.0};
constexpr Command measured{CommandKind::measured, 0, 3.0};

}  // namespace

TEST_CASE("a withdrawn command never reaches the consumer", "[cycle]") {
  CommandQueue queue;
  const auto first = queue.try_push(disable);
  const auto second = queue.try_push(measured);
  REQUIRE(first);
  REQUIRE(second);
  CHECK(queue.withdraw(*first));
  CHECK_FALSE(queue.withdraw(*first));
  Command command;
  REQUIRE(queue.try_pop(command));
  CHECK(command.kind == CommandKind::measured);
  CHECK_FALSE(queue.withdraw(*second));
  CHECK(queue.taken() == 2);
  // Also after its slot has been reused.
  for (std::size_t i = 0; i < CommandQueue::capacity; ++i) REQUIRE(queue.try_push(disable));
  CHECK_FALSE(queue.withdraw(*second));
  CHECK_FALSE(queue.try_push(disable));
}

TEST_CASE("a command is done with the step that takes it, and the report includes it", "[cycle]") {
  SteppedCycle stepped;
  const auto outcome = stepped.handle.send(disable, stepped.now);
  REQUIRE(outcome);
  stepped.handle.poll(stepped.now);
  CHECK(*outcome == Outcome::waiting);
  CHECK(stepped.handle.is_busy());
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK(*outcome == Outcome::done);
  CHECK(stepped.done.size() == 1);
  CHECK_FALSE(stepped.cycle.report().enabled);
  CHECK_FALSE(stepped.handle.is_busy());
}

TEST_CASE("a command that is not taken in time is withdrawn permanently", "[cycle]") {
  SteppedCycle stepped;
  const auto outcome = stepped.handle.send(disable, stepped.now);
  stepped.handle.poll(stepped.now + CycleHandle::patience - 1ms);
  CHECK(*outcome == Outcome::waiting);
  stepped.handle.poll(stepped.now + CycleHandle::patience);
  CHECK(*outcome == Outcome::withdrawn);
  for (int i = 0; i < 20; ++i) stepped.step();
  stepped.handle.poll(stepped.now + 2 * CycleHandle::patience);
  CHECK(stepped.cycle.report().enabled);
  CHECK(stepped.done.empty());
}

TEST_CASE("new parts that are not taken in time are withdrawn, and the next ones are taken",
          "[cycle]") {
  SteppedCycle stepped;
  auto late = stepped.handle.replace(stepped.next_parts(2.0), stepped.now);
  CHECK(stepped.handle.replacing());
  stepped.handle.poll(stepped.now + CycleHandle::patience);
  CHECK(*late == Outcome::withdrawn);
  CHECK_FALSE(stepped.handle.replacing());
  for (int i = 0; i < 20; ++i) stepped.step();
  CHECK(stepped.gain() == 1.0);
  // Later commands and reports are those of the running parts.
  REQUIRE(stepped.handle.send(disable, stepped.now));
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK_FALSE(stepped.cycle.report().enabled);
  auto again = stepped.handle.replace(stepped.next_parts(3.0), stepped.now);
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK(*again == Outcome::done);
  CHECK(stepped.gain() == 3.0);
  CHECK_FALSE(stepped.cycle.report().enabled);
}

TEST_CASE("a change-over that main sees late is completed late", "[cycle]") {
  SteppedCycle stepped;
  auto outcome = stepped.handle.replace(stepped.next_parts(2.0), stepped.now);
  stepped.step();
  // Until poll(), configuration and reports are those of the old parts.
  CHECK(stepped.gain() == 1.0);
  stepped.handle.poll(stepped.now + 10 * CycleHandle::patience);
  CHECK(*outcome == Outcome::done);
  CHECK(stepped.gain() == 2.0);
}

TEST_CASE("a command of the step in which the parts change is reported by the new ones",
          "[cycle]") {
  SteppedCycle stepped;
  auto parts = stepped.handle.replace(stepped.next_parts(2.0), stepped.now);
  auto command = stepped.handle.send(disable, stepped.now);
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK(*parts == Outcome::done);
  CHECK(*command == Outcome::done);
  CHECK_FALSE(stepped.cycle.parts().estimator.persistent_state(stepped.cycle.report()).enabled);
}

TEST_CASE("new parts wait for commands that name an axis, as they may number axes differently",
          "[cycle]") {
  SteppedCycle stepped({"y", "z"});
  const auto command = stepped.handle.send(measured, stepped.now);  // of y
  auto parts = stepped.handle.replace(stepped.next_parts(2.0, {"z", "y"}), stepped.now);
  stepped.step();
  CHECK(stepped.gain() == 1.0);
  stepped.handle.poll(stepped.now);
  CHECK(*command == Outcome::done);
  CHECK(stepped.cycle.report().axes[0].measured_um == 3.0);
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK(*parts == Outcome::done);
  CHECK(stepped.cycle.report().axes[1].measured_um == 3.0);
}

TEST_CASE("commands beyond the queue's capacity are refused, not lost", "[cycle]") {
  SteppedCycle stepped;
  std::vector<CycleHandle::Tracked> sent;
  while (auto outcome = stepped.handle.send(disable, stepped.now)) sent.push_back(outcome);
  CHECK(sent.size() == CommandQueue::capacity);
  stepped.handle.poll(stepped.now + CycleHandle::patience);
  for (const auto& outcome : sent) CHECK(*outcome == Outcome::withdrawn);
  // Their slots are free once the cycle has skipped them.
  CHECK_FALSE(stepped.handle.send(disable, stepped.now));
  stepped.step();
  const auto outcome = stepped.handle.send(disable, stepped.now);
  REQUIRE(outcome);
  stepped.step();
  stepped.handle.poll(stepped.now);
  CHECK(*outcome == Outcome::done);
}

TEST_CASE("after the cycle's end exactly the commands it carried out are done", "[cycle]") {
  SteppedCycle stepped;
  const auto taken = stepped.handle.send(disable, stepped.now);
  auto parts = stepped.handle.replace(stepped.next_parts(2.0), stepped.now);
  stepped.step();
  const auto left = stepped.handle.send({CommandKind::enable, 0, 0.0}, stepped.now);
  stepped.handle.settle();
  CHECK(*taken == Outcome::done);
  CHECK(*parts == Outcome::done);
  CHECK(*left == Outcome::withdrawn);
  CHECK_FALSE(stepped.cycle.report().enabled);
  auto unused = stepped.handle.replace(stepped.next_parts(3.0), stepped.now);
  stepped.handle.settle();
  CHECK(*unused == Outcome::withdrawn);
  CHECK(stepped.gain() == 2.0);
}
