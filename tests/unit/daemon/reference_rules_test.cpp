// Conditions for taking a reference.
#include "daemon/status/reference_rules.hpp"

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "status/figures.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using Catch::Matchers::Contains;

namespace {

const std::vector<std::string> columns{"bed_degC", "spindle_degC"};

std::vector<InputReport> inputs(double bed_degC, double spindle_degC) {
  return {{bed_degC, 20.0, true, false, 0.0, not_a_number},
          {spindle_degC, 20.0, true, false, 0.0, not_a_number}};
}

/// Two columns and an axis.
struct Machine {
  Machine() {
    config.estimator.axes = {{"z", "z_um", 1.0, {}}};
    config.model.inputs = columns;
    config.model.outputs = {"z_um"};
    config.model.matrix_um_per_K = {{5.0, 1.0}};
    report.axes.resize(1);
    report.axes[0].applied_um = 0.0;
    show(20.0, 20.0);
  }
  void show(double bed_degC, double spindle_degC) {
    report.now = now;
    report.inputs = inputs(bed_degC, spindle_degC);
    if (trend.is_due(now)) trend.note(now, columns, report.inputs);
  }
  /// More than half an hour at these rates.
  void warm(double bed_K_per_h, double spindle_K_per_h, nanoseconds for_time = 40min) {
    for (nanoseconds passed{}; passed < for_time; passed += 1s) {
      now += 1s;
      const double hours = 1e-9 * static_cast<double>(passed.count()) / 3600.0;
      show(20.0 + bed_K_per_h * hours, 20.0 + spindle_K_per_h * hours);
    }
  }
  [[nodiscard]] std::string why() const {
    return joined(against_reference(config, report, health, &trend));
  }

  DaemonConfig config;
  Report report;
  ControllerHealth health;
  TemperatureTrend trend;
  nanoseconds now{1h};
};

}  // namespace

TEST_CASE("a reference is allowed at rest", "[reference]") {
  Machine machine;
  CHECK(machine.why().empty());
  machine.warm(0.5, -1.0);
  CHECK(machine.why().empty());
  CHECK(watched_s(machine.report, &machine.trend) == Approx(1800.0).margin(6.0));
}

TEST_CASE("a reference is refused while an axis is proved", "[reference]") {
  Machine machine;
  machine.report.axes[0].proving = true;
  machine.report.axes[0].offset_um = 3.0;
  CHECK_THAT(machine.why(), Contains("axis z is being proved"));
  machine.report.axes[0].proving = false;
  machine.report.axes[0].offset_um = 0.0;
  CHECK(machine.why().empty());
}

TEST_CASE("a reference is refused with an offset, sent or applied", "[reference]") {
  Machine machine;
  AxisReport& axis = machine.report.axes[0];
  axis.offset_um = 0.3;
  axis.applied_um = -0.25;
  CHECK(machine.why().empty());
  axis.offset_um = -6.0;
  CHECK_THAT(machine.why(), Contains("axis z has an offset of -6.00: switch the compensation off"));
  axis.offset_um = 0.0;
  axis.applied_um = 2.0;
  CHECK_THAT(machine.why(), Contains("axis z has an offset of +2.00"));
  axis.applied_um = not_a_number;  // no read-back
  CHECK(machine.why().empty());
}

TEST_CASE("of many offsets the largest is named", "[reference]") {
  Machine machine;
  machine.config.estimator.axes = {{"x", "x_um", 1.0, {}}, {"z", "z_um", 1.0, {}}};
  machine.report.axes.resize(2);
  machine.report.axes[0].offset_um = 2.0;
  machine.report.axes[1].offset_um = -6.0;
  CHECK_THAT(machine.why(), Contains("axis z has an offset of -6.00 (the largest of 2 axes)"));
}

TEST_CASE("no reference while cutting, nor without a sensor", "[reference]") {
  Machine machine;
  machine.report.reasons = static_cast<std::uint32_t>(Reason::cutting);
  CHECK_THAT(machine.why(), Contains("cutting"));
  CHECK(lost_for_reference(machine.config.model, machine.report).empty());
  machine.report.inputs[1].good = false;
  CHECK(lost_for_reference(machine.config.model, machine.report) ==
        std::vector<std::string>{"spindle_degC has no good sensor now"});
}

TEST_CASE("in a dry run only the controller's own offset counts", "[reference]") {
  Machine machine;
  machine.config.dry_run = true;
  machine.report.axes[0].offset_um = -6.0;
  machine.report.axes[0].applied_um = -6.0;
  CHECK(machine.why().empty());
  machine.health.shown_um.emplace();
  machine.health.shown_um->fill(not_a_number);
  CHECK(machine.why().empty());
  (*machine.health.shown_um)[0] = 4.0;
  CHECK_THAT(machine.why(), Contains("axis z has an offset of +4.00"));
}

TEST_CASE("a reference is refused while the machine warms or cools", "[reference]") {
  Machine machine;
  machine.warm(1.0, 6.0);
  CHECK_THAT(machine.why(), Contains("spindle_degC changes by +6.0 K/h (over 30 min)") &&
                                Contains("the machine is warming"));
  machine.warm(0.0, 0.0);
  CHECK(machine.why().empty());
  machine.warm(-9.0, -4.0);
  CHECK_THAT(machine.why(), Contains("bed_degC changes by -9.0 K/h") && Contains("cooling"));
}

TEST_CASE("a step of a coarse module does not count as warming", "[reference]") {
  Machine machine;
  machine.warm(0.0, 0.0, 60s);
  machine.now += 1s;
  machine.show(20.1, 20.0);  // 6 K/h over a minute
  CHECK(machine.why().empty());
  machine.now += 1s;
  machine.show(22.0, 20.0);
  CHECK_THAT(machine.why(), Contains("bed_degC"));
}

TEST_CASE("a cooler's limit cycle within half an hour does not count as warming", "[reference]") {
  Machine machine;
  double steepest = 0.0;
  for (int second = 0; second < 7200; ++second) {
    machine.now += 1s;
    // 28 min, +-0.3 K: up to 4 K/h for minutes, no trend over half an hour
    machine.show(20.0, 20.0 + 0.3 * std::sin(2.0 * 3.14159265 * second / 1680.0));
    if (second < 1800) continue;
    const auto change = machine.trend.change(1, machine.now, machine.report.inputs[1].temp_degC);
    steepest = std::max(steepest, std::abs(change.rate_K_per_h));
  }
  CHECK(steepest < TemperatureTrend::even_rate_K_per_h_max);
}

TEST_CASE("unknown quantities do not prevent a reference", "[reference]") {
  Machine machine;
  CHECK(watched_s(machine.report, &machine.trend) == 0.0);
  machine.warm(0.0, 30.0, 2s);
  CHECK(machine.why().empty());
  machine.warm(0.0, 30.0);
  REQUIRE_FALSE(machine.why().empty());
  machine.report.inputs[1].temp_degC = not_a_number;
  CHECK(machine.why().empty());
  // Other columns reset the trend.
  machine.now += 10s;
  machine.trend.note(machine.now, {"a_degC", "b_degC"}, inputs(20.0, 90.0));
  CHECK(std::isnan(machine.trend.change(0, machine.now, 20.0).rate_K_per_h));
  CHECK(against_reference(machine.config, machine.report, machine.health, nullptr).empty());
}

TEST_CASE("a machine that warmed while a start took its reference is named", "[reference]") {
  Machine machine;
  machine.warm(1.0, 60.0, 2min);
  CHECK(change_since_start(machine.config.model, machine.report, machine.trend) ==
        "spindle_degC +60.0 K/h");
  Machine even;
  even.warm(1.0, -2.0, 2min);
  CHECK(change_since_start(even.config.model, even.report, even.trend).empty());
}
