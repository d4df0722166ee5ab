/// Reference of the displacement, and when it is taken.
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/pipeline/prediction.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

/// Input of the reference in one step: two columns and the spindle's speed.
struct Moment {
  std::vector<double> temps_degC{20.0, 21.0};
  std::vector<std::uint8_t> good{1, 1};
  std::vector<double> reported{3000.0};
  bool online{true};
  nanoseconds now{0};
  std::vector<nanoseconds> refuted_at{nanoseconds::min(), nanoseconds::min()};

  [[nodiscard]] ReferenceState step(Reference& reference) const {
    Temperatures temps;
    temps.measured_degC = temps_degC;
    temps.good = good;
    temps.refuted_at = refuted_at;
    Signals signals;
    signals.online = online;
    signals.of_model = reported;
    return reference.step(now, temps, signals);
  }
};

ThermalModel with_numbers(std::vector<double> numbers) {
  ThermalModel model = model_with_growth();
  model.reference_degC = std::move(numbers);
  return model;
}

}  // namespace

TEST_CASE("without numbers each column's first good value is the reference, and stays",
          "[reference]") {
  Reference reference(model_with_growth());
  Moment moment;
  moment.good[1] = 0;
  ReferenceState state = moment.step(reference);
  CHECK(state.changed);
  CHECK_FALSE(state.known);
  CHECK(state.temps_degC[0] == 20.0);
  CHECK(std::isnan(state.temps_degC[1]));

  moment.temps_degC = {25.0, 26.0};
  moment.good[1] = 1;
  state = moment.step(reference);
  CHECK(state.known);
  CHECK(state.temps_degC[0] == 20.0);
  CHECK(state.temps_degC[1] == 26.0);

  moment.temps_degC = {30.0, 30.0};
  state = moment.step(reference);
  CHECK_FALSE(state.changed);
  CHECK(state.temps_degC[1] == 26.0);
}

TEST_CASE("a sampled reference takes the signals of an online controller; given numbers mean rest",
          "[reference]") {
  Reference sampled(model_with_growth());
  Moment silent;
  silent.online = false;
  CHECK(std::isnan(silent.step(sampled).signals[0]));
  CHECK(Moment{}.step(sampled).signals[0] == 3000.0);

  Reference numbers(with_numbers({20.0, 20.0}));
  const ReferenceState state = Moment{}.step(numbers);
  CHECK(state.known);
  CHECK_FALSE(state.changed);
  CHECK(state.signals[0] == 0.0);
}

TEST_CASE("a commanded reference has its signals from the next step on", "[reference]") {
  Reference reference(with_numbers({20.0, 20.0}));
  (void)Moment{}.step(reference);
  reference.take(std::vector<double>{24.0, 25.0});
  CHECK(std::isnan(reference.signals()[0]));
  const ReferenceState state = Moment{}.step(reference);
  CHECK(state.changed);
  CHECK(state.temps_degC[0] == 24.0);
  CHECK(state.temps_degC[1] == 25.0);
  CHECK(state.signals[0] == 3000.0);
}

TEST_CASE("a restart restores finite numbers by name", "[reference]") {
  Reference reference(model_with_growth());
  reference.restore({{"t1_degC", 18.5}, {"t2_degC", not_a_number}, {"t9_degC", 1.0}},
                    {{"spindle_rpm", 500.0}});
  CHECK(reference.temps_degC()[0] == 18.5);
  CHECK(std::isnan(reference.temps_degC()[1]));
  CHECK(reference.signals()[0] == 500.0);
}

TEST_CASE("a reload keeps the reference unless the model file has new numbers", "[reference]") {
  const std::vector<int> columns{1, 0};  // the new file has the opposite order
  const std::vector<int> signals{-1};
  Reference before(with_numbers({20.0, 20.0}));
  before.take(std::vector<double>{23.0, 24.0});
  Reference same(with_numbers({20.0, 20.0}));
  same.adopt(before, columns, signals);
  CHECK(same.temps_degC()[0] == 24.0);
  CHECK(same.temps_degC()[1] == 23.0);
  CHECK(same.signals()[0] == 0.0);  // a signal that the other did not have
  Reference other(with_numbers({19.0, 20.0}));
  other.adopt(before, columns, signals);
  CHECK(other.temps_degC()[0] == 19.0);
  CHECK(other.temps_degC()[1] == 20.0);
}

TEST_CASE("a first value refuted by a confirmed jump while young is taken anew", "[reference]") {
  using namespace std::chrono_literals;
  Reference reference(model_with_growth());
  Moment moment;
  moment.now = 100s;
  moment.temps_degC = {0.0, 21.0};
  REQUIRE(moment.step(reference).known);
  moment.now = 1000s;
  moment.temps_degC = {23.3, 22.0};
  SECTION("the value was false") {
    moment.refuted_at[0] = 145s;
    const ReferenceState state = moment.step(reference);
    CHECK(state.changed);
    CHECK(state.known);
    CHECK(state.temps_degC[0] == 23.3);
    CHECK(state.temps_degC[1] == 21.0);
    moment.temps_degC[0] = 30.0;
    CHECK_FALSE(moment.step(reference).changed);
  }
  SECTION("it is not known while no value is good") {
    moment.refuted_at[0] = 145s;
    moment.good[0] = 0;
    CHECK_FALSE(moment.step(reference).known);
  }
  SECTION("it had stood for long") {
    moment.refuted_at[0] = 100s + Reference::provisional_time + 1s;
    CHECK_FALSE(moment.step(reference).changed);
  }
  SECTION("the jump was before it") {
    moment.refuted_at[0] = 99s;
    CHECK_FALSE(moment.step(reference).changed);
  }
  SECTION("it had moved since") {
    Reference moving(model_with_growth());
    moment.now = 100s;
    moment.temps_degC = {20.0, 21.0};
    REQUIRE(moment.step(moving).known);
    moment.now = 130s;
    moment.temps_degC[0] = 20.0 + Reference::provisional_K + 0.1;
    CHECK_FALSE(moment.step(moving).changed);
    moment.now = 200s;
    moment.temps_degC[0] = 28.0;
    moment.refuted_at[0] = 145s;
    CHECK(moment.step(moving).temps_degC[0] == 20.0);
  }
  SECTION("an operator had taken it") {
    reference.take(std::vector<double>{0.0, 21.0});
    moment.refuted_at[0] = 145s;
    CHECK(moment.step(reference).temps_degC[0] == 0.0);
  }
}
