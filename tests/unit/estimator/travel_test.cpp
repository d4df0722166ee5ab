// Axes whose controller interpolates along the travel: offsets of their nodes.
#include <algorithm>
#include <cmath>
#include <random>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/model/travel_curves.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

/// x depends on its slide position: 5 um/K at 0 mm, -15 at 400 mm, 0 at 800 mm; t2 is constant.
ThermalModel curved_model() {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"x_um", "z_um"};
  model.matrix_um_per_K = {{0.0, 1.0}, {2.0, 0.0}};
  model.guideways = {
      {"bed", "x_mm", {0.0, 400.0, 800.0}, {{"x_um", {{5.0, 0.0}, {-15.0, 0.0}, {0.0, 0.0}}}}}};
  return model;
}

AxisConfig node_of(double position_mm, TravelForm form) {
  AxisConfig axis{"x", "x_um", 1.0, {100.0, 10.0}};
  axis.node = TravelNode{"x", "x_mm", position_mm, form};
  axis.name = "x_at_" + std::to_string(static_cast<int>(position_mm));
  return axis;
}

/// x along its travel, and z with one offset.
EstimatorConfig travel_config(const std::vector<double>& nodes_mm, TravelForm form) {
  EstimatorConfig config = small_config();
  config.signals = {"x_mm", "cutting_on", "compensation_off_on"};
  config.axes.clear();
  for (const double position_mm : nodes_mm) config.axes.push_back(node_of(position_mm, form));
  config.axes.push_back({"z", "z_um", 1.0, {50.0, 10.0}});
  return config;
}

/// A controller that applies valid offsets at once.
struct TravelMachine : Machine {
  explicit TravelMachine(const EstimatorConfig& config, const ThermalModel& model = curved_model())
      : Machine(config, model), count(config.axes.size()) {
    for (std::size_t i = 0; i < count; ++i) controller.applied_um[i] = 0.0;
  }
  void step_all(const std::vector<double>& temps_degC) {
    now += 1s;
    for (std::size_t i = 0; i < temps_degC.size(); ++i)
      readings[i] = {temps_degC[i], now,
                     std::isnan(temps_degC[i]) ? Fault::open_circuit : Fault::none};
    controller.taken_at = now;
    controller.written = controller.online;
    estimator.step(now, readings, controller, command);
    for (std::size_t i = 0; i < count && controller.online; ++i)
      if (command.valid[i] && !stuck) controller.applied_um[i] = command.offset_um[i];
  }
  void run(int steps, const std::vector<double>& temps_degC) {
    for (int i = 0; i < steps; ++i) step_all(temps_degC);
  }
  std::size_t count;
  bool stuck{false};
};

const std::vector<double> cold{20.0, 20.0};
const std::vector<double> warm{22.0, 23.0};

double worst_of(const std::vector<double>& x, const std::vector<double>& y, double a, double b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double share = (x[i] - x.front()) / (x.back() - x.front());
    worst = std::max(worst, std::abs(y[i] - (a + share * (b - a))));
  }
  return worst;
}

}  // namespace

TEST_CASE("the minimax line is evenly off a bend and exact for a straight line",
          "[estimator][travel]") {
  const std::vector<double> x{0.0, 1.0, 2.0};
  const CurveLine bend = minimax_line(x, std::vector<double>{0.0, 4.0, 2.0});
  CHECK(bend.deviation == Approx(1.5));
  CHECK(bend.at_first == Approx(1.5));
  CHECK(bend.at_last == Approx(3.5));
  const CurveLine straight = minimax_line(x, std::vector<double>{-1.0, 0.0, 1.0});
  CHECK(straight.deviation == Approx(0.0).margin(1e-12));
  CHECK(straight.at_first == Approx(-1.0));
  const CurveLine none = minimax_line(x, std::vector<double>{0.0, not_a_number, 1.0});
  CHECK(std::isnan(none.at_first));
}

TEST_CASE("no line is nearer than the minimax line", "[estimator][travel][property]") {
  const auto seed = GENERATE(range(0u, 200u));
  CAPTURE(seed);
  std::mt19937 engine(seed);
  const auto chance = [&] { return static_cast<double>(engine() % 20001) / 100.0 - 100.0; };
  std::vector<double> x{0.0};
  std::vector<double> y{chance()};
  const std::size_t count = 2 + engine() % 30;
  while (x.size() < count) {
    x.push_back(x.back() + 0.5 + std::abs(chance()));
    y.push_back(engine() % 4 == 0 ? y.back() : chance());
  }
  const CurveLine line = minimax_line(x, y);
  CHECK(worst_of(x, y, line.at_first, line.at_last) == Approx(line.deviation).margin(1e-9));
  // Minimum of a convex function: no neighbour is lower.
  for (const double step : {1.0, 0.01})
    for (const auto& [a, b] :
         {std::pair(1.0, 0.0), std::pair(-1.0, 0.0), std::pair(0.0, 1.0), std::pair(0.0, -1.0),
          std::pair(1.0, -1.0), std::pair(-1.0, 1.0), std::pair(1.0, 1.0), std::pair(-1.0, -1.0)})
      CHECK(worst_of(x, y, line.at_first + step * a, line.at_last + step * b) >=
            line.deviation - 1e-9);
}

TEST_CASE("the nodes of a table get the curve, for any slide position", "[estimator][travel]") {
  TravelMachine machine(travel_config({0.0, 400.0, 800.0}, TravelForm::table));
  machine.run(5, cold);
  machine.controller.signals[0] = 123.0;
  machine.run(20, warm);
  CHECK(machine.command.offset_um[0] == Approx(-(5.0 * 2 + 3)));
  CHECK(machine.command.offset_um[1] == Approx(-(-15.0 * 2 + 3)));
  CHECK(machine.command.offset_um[2] == Approx(-3.0));
  CHECK(machine.command.offset_um[3] == Approx(-4.0));
  const auto before = machine.command.offset_um;
  machine.controller.signals[0] = 790.0;
  machine.step_all(warm);
  CHECK(machine.command.offset_um == before);
}

TEST_CASE("a line is the minimax line of the curve", "[estimator][travel]") {
  TravelMachine machine(travel_config({0.0, 800.0}, TravelForm::line));
  machine.run(5, cold);
  machine.run(20, warm);
  // The curve is -13, 27, -3 at 0, 400, 800 mm: evenly off it by (27 + 8) / 2 = 17.5.
  CHECK(machine.command.offset_um[0] == Approx(-13.0 + 17.5));
  CHECK(machine.command.offset_um[1] == Approx(-3.0 + 17.5));
}

TEST_CASE("a node that does not apply its offset stops the whole axis, and no other",
          "[estimator][travel]") {
  TravelMachine machine(travel_config({0.0, 400.0, 800.0}, TravelForm::table));
  machine.run(5, cold);
  machine.run(20, warm);
  REQUIRE(machine.command.valid[0]);
  for (int i = 0; i < 4; ++i) {
    machine.controller.applied_um[1] = -70.0;
    machine.stuck = true;
    machine.step_all(warm);
    CHECK_FALSE(machine.command.valid[0]);
    CHECK_FALSE(machine.command.valid[1]);
    CHECK_FALSE(machine.command.valid[2]);
    CHECK(machine.command.valid[3]);
  }
  machine.stuck = false;
  CHECK(machine.report().axes[1].latched);
  CHECK_FALSE(machine.report().axes[0].driven);
  const auto before_um = machine.command.offset_um;
  machine.run(5, {25.0, 20.0});
  CHECK(machine.command.offset_um[0] == before_um[0]);
  CHECK(machine.command.offset_um[2] == before_um[2]);
  machine.controller.applied_um[1] = before_um[1];
  machine.estimator.apply({CommandKind::release, 0, 0.0});
  machine.run(30, {25.0, 20.0});
  CHECK(machine.command.valid[1]);
  CHECK(machine.command.offset_um[1] == Approx(75.0));
}

TEST_CASE("a proving move covers the whole travel", "[estimator][travel]") {
  TravelMachine machine(travel_config({0.0, 800.0}, TravelForm::line));
  machine.run(5, cold);
  machine.estimator.apply({CommandKind::prove, 0, 5.0});
  machine.run(2, cold);
  CHECK(machine.command.offset_um[0] == Approx(5.0));
  CHECK(machine.command.offset_um[1] == Approx(5.0));
  CHECK(machine.command.offset_um[2] == 0.0);
}

TEST_CASE("a value measured at the slide's position corrects all nodes alike",
          "[estimator][travel]") {
  EstimatorConfig config = travel_config({0.0, 800.0}, TravelForm::line);
  config.correction.form = CorrectionForm::recursive;
  config.correction.measured = MeasuredMeaning::remaining;
  config.correction.groups = {{"t2_degC"}};
  TravelMachine machine(config);
  machine.run(5, cold);
  machine.controller.signals[0] = 400.0;
  machine.run(20, warm);
  const auto before_um = machine.command.offset_um;
  // The curve is 27 there and the line 9.5: the rest remains, and the model accounts for all of it.
  machine.estimator.apply({CommandKind::measured, 0, -27.0 + 9.5});
  machine.run(30, warm);
  CHECK(machine.command.offset_um[0] == Approx(before_um[0]).margin(0.05));
  CHECK(machine.command.offset_um[1] == Approx(before_um[1]).margin(0.05));
  machine.estimator.apply({CommandKind::measured, 0, -27.0 + 9.5 + 4.0});
  machine.run(60, warm);
  const double change_um = machine.command.offset_um[0] - before_um[0];
  CHECK(change_um < -1.0);
  CHECK(machine.command.offset_um[1] - before_um[1] == Approx(change_um).margin(0.01));
}

TEST_CASE("the state held at a cycle end is held along the whole travel", "[estimator][travel]") {
  EstimatorConfig config = travel_config({0.0, 400.0, 800.0}, TravelForm::table);
  config.compensation.update = UpdateRule::each_cycle;
  TravelMachine machine(config);
  machine.run(5, cold);
  machine.run(5, warm);
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  machine.run(1, warm);
  machine.run(20, {30.0, 30.0});
  CHECK(machine.command.offset_um[0] == Approx(-13.0));
  CHECK(machine.command.offset_um[1] == Approx(27.0));
  CHECK(machine.command.offset_um[2] == Approx(-3.0));
}

TEST_CASE("impossible nodes are refused", "[estimator][travel]") {
  const auto refused = [](const EstimatorConfig& config) {
    CHECK_THROWS_AS(TravelCurves(config, curved_model()), InvalidValue);
  };
  EstimatorConfig config = travel_config({0.0, 800.0}, TravelForm::line);
  config.axes[0].node->position = config.axes[1].node->position = "y_mm";
  refused(config);
  refused(travel_config({800.0, 0.0}, TravelForm::table));
  refused(travel_config({0.0}, TravelForm::table));
}

TEST_CASE("entries of one travel are one axis", "[estimator][travel]") {
  const EstimatorConfig config = travel_config({0.0, 400.0, 800.0}, TravelForm::table);
  CHECK(axis_spans(config.axes) == std::vector<AxisSpan>{{0, 3}, {3, 1}});
  CHECK(span_of(config.axes, 2) == AxisSpan{0, 3});
  const auto nodes = std::span(config.axes).first(3);
  const std::vector<double> values{1.0, 3.0, -1.0};
  CHECK(value_on_travel(nodes, values, 200.0) == Approx(2.0));
  CHECK(value_on_travel(nodes, values, 600.0) == Approx(1.0));
  CHECK(value_on_travel(nodes, values, -5.0) == Approx(1.0));
  CHECK(value_on_travel(nodes, values, 900.0) == Approx(-1.0));
}
