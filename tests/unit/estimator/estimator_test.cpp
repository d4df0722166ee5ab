#include "estimator/pipeline/estimator.hpp"

#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

TEST_CASE("the reference is the first valid sample and stays", "[estimator]") {
  Machine machine;
  machine.step({20.0, lost});
  CHECK(machine.report().mode == Mode::starting);
  CHECK(machine.reports(Reason::no_reference));
  CHECK(machine.reports(Reason::block_lost));
  CHECK(machine.offset_um() == 0.0);
  machine.step({20.5, 30.0});
  CHECK(machine.report().inputs[0].reference_degC == 20.0);
  CHECK(machine.report().inputs[1].reference_degC == 30.0);
  machine.steps(10, {21.0, 31.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.report().reasons == 0);
  CHECK(machine.report().inputs[0].reference_degC == 20.0);
  // 5 x 1 K + 1 x 1 K: the offset is its negative.
  CHECK(machine.offset_um() == -6.0);
  CHECK(machine.report().axes[0].displacement_um == 6.0);
}

TEST_CASE("an axis with sign -1 gets the offset with the opposite sign", "[estimator]") {
  auto config = small_config();
  config.axes[0].sign = -1.0;
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 31.0});
  CHECK(machine.offset_um() == 6.0);
}

TEST_CASE("without confirmed writes nothing is compensated", "[estimator]") {
  Machine machine;
  machine.controller.written = false;
  machine.steps(5, {20.0, 30.0});
  CHECK(machine.report().mode == Mode::starting);
  CHECK(machine.reports(Reason::not_written));
  CHECK(machine.command.valid[0]);  // else it would never be written
  machine.controller.written = true;
  machine.steps(5, {21.0, 30.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.report().reasons == 0);
  CHECK(machine.offset_um() == -5.0);
  machine.controller.written = false;
  machine.steps(5, {22.0, 30.0});
  CHECK(machine.report().mode == Mode::holding);
  CHECK(machine.reports(Reason::not_written));
  CHECK(machine.offset_um() == -5.0);
  machine.controller.online = false;
  machine.step({22.0, 30.0});
  CHECK(machine.reports(Reason::controller_offline));
  CHECK_FALSE(machine.reports(Reason::not_written));
}

TEST_CASE("a signal that is missing or garbled holds the offset and has no later effect",
          "[estimator]") {
  auto model = small_model();
  model.terms = {{"missing_heat_source",
                  "spindle_rpm",
                  {{"tau_s", 60.0}, {"power", 2.0}},
                  {{"gain_um_per_unit", {{"z_um", 1e-7}}}}}};
  Machine machine(small_config(), model);
  machine.step({20.0, 30.0});
  machine.steps(5, {21.0, 30.0});
  for (const double garbage : {not_a_number, 3e38, -1e200, 1e300}) {
    machine.controller.signals[0] = garbage;
    machine.steps(3, {22.0, 30.0});
    CHECK(machine.reports(Reason::signal_lost));
    CHECK(machine.report().mode == Mode::holding);
    CHECK(machine.offset_um() == -5.0);
  }
  machine.controller.signals[0] = 0.0;
  machine.steps(3, {21.0, 30.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.offset_um() == -5.0);
}

TEST_CASE("disable and enable move at the slew rate", "[estimator]") {
  auto config = small_config();
  config.axes[0].limiter.rate_um_per_s_max = 1.0;
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(20, {21.0, 30.0});
  machine.estimator.apply({CommandKind::disable, 0, 0.0});
  for (int i = 1; i <= 7; ++i) {
    machine.step({21.0, 30.0});
    CHECK(machine.offset_um() == std::min(-5.0 + i, 0.0));
  }
  CHECK(machine.report().mode == Mode::disabled);
  CHECK_FALSE(machine.report().enabled);
  CHECK(machine.reports(Reason::operator_disabled));
  machine.estimator.apply({CommandKind::enable, 0, 0.0});
  for (int i = 1; i <= 7; ++i) {
    machine.step({21.0, 30.0});
    CHECK(machine.offset_um() == std::max(-1.0 * i, -5.0));
  }
}

TEST_CASE("measured and cycle end are reported and move nothing", "[estimator]") {
  Machine machine;
  machine.steps(3, {20.0, 30.0});
  machine.estimator.apply({CommandKind::measured, 0, 3.5});
  machine.estimator.apply({CommandKind::measured, 77, 1.0});
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  machine.step({20.0, 30.0});
  CHECK(machine.report().axes[0].measured_um == 3.5);
  CHECK(machine.report().cycle_ends == 1);
  CHECK(machine.offset_um() == 0.0);
}

TEST_CASE("a part measured later than the kept past is counted as refused", "[estimator]") {
  Machine machine;
  machine.steps(3, {20.0, 30.0});
  Command part{CommandKind::measured, 0, 3.5};
  part.ago_s = 600;
  part.source = MeasuredSource::part;
  machine.estimator.apply(part);
  machine.step({20.0, 30.0});
  CHECK(machine.report().remembered_s == 0.0);
  CHECK(machine.report().axes[0].correction.refused == 1);
  CHECK(machine.report().axes[0].correction.taken == 0);
}

TEST_CASE("a restored reference outside the sensors' range is refused with its key",
          "[estimator]") {
  for (const double reference_degC : {1e300, -300.0, 200.1, -30.1}) {
    PersistentState state;
    state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", reference_degC}};
    Machine machine;
    const auto refused = machine.estimator.restore(state);
    REQUIRE(refused.size() == 1);
    CHECK(refused[0].find("reference_degC.t2_degC = ") == 0);
    CHECK(refused[0].find("must be in [-30, 200]") != std::string::npos);
    // A reference taken now would be in an arbitrary state: nothing is compensated.
    machine.steps(5, {40.0, 50.0});
    CHECK(machine.report().mode == Mode::disabled);
    CHECK(machine.offset_um() == 0.0);
    machine.estimator.apply({CommandKind::reference, 0, 0.0});
    machine.estimator.apply({CommandKind::enable, 0, 0.0});
    machine.steps(5, {41.0, 50.0});
    CHECK(machine.report().mode == Mode::compensating);
    CHECK(machine.offset_um() == Approx(-5.0));
  }
}

TEST_CASE("a reference in the model outside the sensors' range is refused", "[estimator]") {
  for (const double reference_degC : {1e300, -300.0, 200.1}) {
    ThermalModel model = small_model();
    model.reference_degC = {20.0, reference_degC};
    try {
      const Estimator estimator(small_config(), model);
      FAIL("taken");
    } catch (const InvalidValue& error) {
      CHECK(error.key() == "reference[1]");
    }
  }
}

TEST_CASE("a non-finite target holds the offset, with a reason", "[estimator]") {
  ThermalModel model = small_model();
  model.matrix_um_per_K = {{1e308, 1e308}};
  Machine machine(small_config(), model);
  machine.steps(3, {20.0, 30.0});
  REQUIRE(machine.report().mode == Mode::compensating);
  machine.steps(3, {21.0, 31.0});
  CHECK(machine.report().mode == Mode::holding);
  CHECK(machine.reports(Reason::no_target));
  CHECK(machine.offset_um() == 0.0);
  machine.steps(3, {20.0, 30.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK_FALSE(machine.reports(Reason::no_target));
}

TEST_CASE("while compensating the target is a number, also before the first cycle end",
          "[estimator]") {
  EstimatorConfig config = small_config();
  config.compensation.update = UpdateRule::each_cycle;
  Machine machine(config);
  machine.steps(3, {20.0, 30.0});
  machine.steps(3, {25.0, 30.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.report().axes[0].target_um == 0.0);
}

TEST_CASE("an operator releases a latched axis and no other", "[estimator]") {
  Machine machine;
  machine.steps(3, {20.0, 30.0});
  machine.steps(20, {24.0, 30.0});
  REQUIRE(machine.offset_um() == Approx(-20.0));
  machine.controller.applied_um[0] = 0.0;  // re-homed
  machine.steps(2, {24.0, 30.0});
  CHECK(machine.reports(Reason::mismatch_latched));
  CHECK(machine.report().axes[0].latched_mismatch.read_um == 0.0);
  machine.steps(60, {24.0, 30.0});
  CHECK_FALSE(machine.command.valid[0]);
  machine.estimator.apply({CommandKind::release, 7, 0.0});
  machine.estimator.apply({CommandKind::release, 0, 0.0});
  machine.steps(20, {24.0, 30.0});
  CHECK_FALSE(machine.reports(Reason::mismatch_latched));
  CHECK(machine.offset_um() == Approx(-20.0));
  CHECK(machine.controller.applied_um[0] == Approx(-20.0));
}

TEST_CASE("a restart continues with switch, reference and offset", "[estimator]") {
  Machine machine;
  PersistentState state;
  state.enabled = true;
  state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", 30.0}, {"gone_degC", 1.0}};
  state.offset_um = {{"z", -8.0}};
  machine.estimator.restore(state);
  machine.controller.applied_um[0] = -8.0;
  machine.steps(3, {22.0, 30.0});
  CHECK(machine.report().inputs[0].reference_degC == 20.0);
  CHECK(machine.offset_um() == -10.0);

  Machine disabled;
  state.enabled = false;
  disabled.estimator.restore(state);
  disabled.controller.applied_um[0] = -8.0;
  disabled.steps(3, {22.0, 30.0});
  CHECK(disabled.report().mode == Mode::disabled);
  CHECK(disabled.offset_um() == 0.0);
}

TEST_CASE("new numbers in the model file replace the stored reference", "[estimator]") {
  ThermalModel model = small_model();
  model.reference_degC = {18.0, 30.0};
  PersistentState state;
  state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", 30.0}};
  state.model_reference_degC = {{"t1_degC", 18.0}, {"t2_degC", 30.0}};
  Machine unchanged(small_config(), model);
  unchanged.estimator.restore(state);
  unchanged.step({22.0, 30.0});
  CHECK(unchanged.report().inputs[0].reference_degC == 20.0);  // commanded since, and kept

  model.reference_degC[0] = 17.0;
  Machine edited(small_config(), model);
  edited.estimator.restore(state);
  edited.step({22.0, 30.0});
  CHECK(edited.report().inputs[0].reference_degC == 17.0);
}

TEST_CASE("a reload does not move the axis by itself", "[estimator]") {
  Machine machine(small_config(), model_with_growth());
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 30.0});
  REQUIRE(machine.offset_um() == -5.0);
  reload(machine, small_config(), model_with_growth());
  machine.step({21.0, 30.0});
  CHECK(machine.offset_um() == -5.0);
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.command.valid[0]);
  CHECK(machine.report().cycle == 12);
}

TEST_CASE("the error of probings is that of a model: another one begins anew", "[estimator]") {
  Machine machine;
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 30.0});
  machine.estimator.apply({CommandKind::measured, 0, 2.0});
  machine.step({21.0, 30.0});
  REQUIRE(std::isfinite(machine.report().axes[0].probed_rms_um));
  reload(machine, small_config(), small_model());
  machine.step({21.0, 30.0});
  CHECK(std::isfinite(machine.report().axes[0].probed_rms_um));
  ThermalModel other = small_model();
  other.matrix_um_per_K[0][0] *= 2.0;
  reload(machine, small_config(), other);
  machine.step({21.0, 30.0});
  CHECK(std::isnan(machine.report().axes[0].probed_rms_um));
}

TEST_CASE("a probing of which the model explains less than half is kept over a restart",
          "[estimator]") {
  const double noise_um = small_config().correction.noise_um;
  const auto probed = [&](Machine& machine, double left_um) {
    machine.estimator.apply({CommandKind::measured, 0, left_um});
    machine.step({21.0, 30.0});
    return machine.report().axes[0].last_probing;
  };
  Machine machine;
  machine.step({20.0, 30.0});
  machine.steps(20, {21.0, 30.0});
  REQUIRE(machine.offset_um() == -5.0);
  CHECK_FALSE(probed(machine, 0.0).is_unexplained(noise_um));
  CHECK_FALSE(probed(machine, 4.0).is_unexplained(noise_um));  // 5 of 9 um are explained
  CHECK_FALSE(LastProbing{2.0, 0.0}.is_unexplained(noise_um));
  const LastProbing last = probed(machine, 90.0);
  CHECK(last.is_unexplained(noise_um));
  CHECK(last.model_um == Approx(5.0));
  Machine again;
  again.now = machine.now + 5s;
  REQUIRE(again.estimator.restore(machine.estimator.persistent_state(machine.report())).empty());
  again.step({21.0, 30.0});
  CHECK(again.report().axes[0].last_probing.without_offset_um == last.without_offset_um);
  again.estimator.apply({CommandKind::reference});
  again.step({21.0, 30.0});
  CHECK_FALSE(again.report().axes[0].last_probing.is_unexplained(noise_um));
}

TEST_CASE("a reload takes new numbers as the reference and keeps an old one", "[estimator]") {
  Machine machine;
  machine.step({20.0, 30.0});
  machine.steps(5, {21.0, 30.0});
  auto model = small_model();
  model.reference_degC = {21.0, 30.0};
  reload(machine, small_config(), model);
  machine.steps(5, {21.0, 30.0});
  CHECK(machine.offset_um() == 0.0);
  machine.estimator.apply({CommandKind::reference, 0, 0.0});
  machine.steps(5, {21.5, 30.0});
  reload(machine, small_config(), model);
  machine.steps(5, {21.5, 30.0});
  CHECK(machine.report().inputs[0].reference_degC == 21.0);
}

TEST_CASE("an estimator with a loaded state continues bit for bit", "[estimator]") {
  auto config = small_config();
  for (SensorConfig& sensor : config.sensors) {
    sensor.smoothing.form = SmoothingForm::sliding_line;
    sensor.smoothing.period_s = 0;
  }
  Machine machine(config, model_with_growth());
  const auto temps = [](int i) {
    return std::vector<double>{20.0 + 0.3 * std::sin(0.1 * i), 30.0 + 0.01 * i};
  };
  for (int i = 0; i < 40; ++i) machine.step(temps(i));
  machine.estimator.apply({CommandKind::prove, 0, 2.0});
  machine.steps(2, temps(40));
  std::vector<std::byte> state(machine.estimator.state_size_bytes());
  machine.estimator.save_state(state);
  Machine twin(config, model_with_growth());
  twin.estimator.load_state(state);
  twin.now = machine.now;
  twin.controller = machine.controller;
  for (int i = 42; i < 100; ++i) {
    machine.step(temps(i));
    twin.step(temps(i));
    REQUIRE(machine.offset_um() == twin.offset_um());
  }
  std::vector<std::byte> twin_state(state.size());
  machine.estimator.save_state(state);
  twin.estimator.save_state(twin_state);
  CHECK(state == twin_state);
}

TEST_CASE("a state of another size is refused", "[estimator]") {
  Machine machine;
  std::vector<std::byte> state(machine.estimator.state_size_bytes());
  machine.estimator.save_state(state);
  state.pop_back();
  CHECK_THROWS_AS(machine.estimator.load_state(state), std::runtime_error);
}

TEST_CASE("configuration and model that do not fit are refused", "[estimator]") {
  const auto refused = [](auto change) {
    auto config = small_config();
    auto model = model_with_growth();
    change(config, model);
    CHECK_THROWS_AS(Estimator(config, model), InvalidValue);
  };
  refused([](auto& config, auto&) { config.axes[0].output = "y_um"; });
  refused([](auto& config, auto&) { config.signals = {"cutting_on", "compensation_off_on"}; });
  refused([](auto& config, auto&) { config.compensation.disable_signal = "no_on"; });
  refused([](auto& config, auto&) { config.blocks.pop_back(); });
  refused([](auto& config, auto&) { config.compensation.mismatch_um = not_a_number; });
  refused([](auto&, auto& model) { model.matrix_um_per_K[0].pop_back(); });
  refused([](auto&, auto& model) { model.matrix_um_per_K[0][1] = not_a_number; });
  refused([](auto&, auto& model) { model.matrix_um_per_K[0][0] = HUGE_VAL; });
  // The model's own check comes before any other use of its rows.
  refused([](auto& config, auto& model) {
    config.correction.form = CorrectionForm::recursive;
    config.correction.groups = {{model.inputs[0]}};
    model.matrix_um_per_K.clear();
  });
}
