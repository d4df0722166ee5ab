#include "drivers/controllers/kinds/modbus/piezo_drive.hpp"

#include <chrono>
#include <cmath>
#include <random>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

PiezoConfig measured_piezo() {
  PiezoConfig config;
  config.curve_V = {0.0, 20.0, 50.0, 100.0};
  config.curve_um = {-20.0, -12.0, 2.0, 25.0};
  return config;
}

}  // namespace

TEST_CASE("the inverted curve returns every displacement within it", "[piezo]") {
  const PiezoConfig config = measured_piezo();
  for (double um = -20.0; um <= 25.0; um += 0.25)
    CHECK(displacement_at(config, volt_at(config, um)) == Approx(um).margin(1e-9));
  CHECK(volt_at(config, 2.0) == 50.0);
}

TEST_CASE("beyond the curve its ends are the limits", "[piezo]") {
  const PiezoConfig config = measured_piezo();
  CHECK(volt_at(config, 1e9) == 100.0);
  CHECK(volt_at(config, -1e9) == 0.0);
  CHECK(std::isnan(volt_at(config, not_a_number)));
}

TEST_CASE("a curve that cannot be inverted is refused", "[piezo]") {
  PiezoConfig config = measured_piezo();
  config.curve_um[2] = -12.0;
  CHECK_THROWS_AS(PiezoDrive(config), InvalidValue);
  config = measured_piezo();
  config.curve_V[0] = 5.0;
  CHECK_THROWS_AS(PiezoDrive(config), InvalidValue);
  config = measured_piezo();
  config.curve_um.pop_back();
  CHECK_THROWS_AS(PiezoDrive(config), InvalidValue);
}

TEST_CASE("a new voltage comes after 0 V, once the offset is steady", "[piezo]") {
  PiezoDrive drive(measured_piezo());
  CHECK(std::isnan(drive.step(0s, 2.0)));
  CHECK(std::isnan(drive.step(900ms, 2.0)));
  CHECK(drive.step(1s, 2.0) == 0.0);
  CHECK(drive.step(1100ms, 2.0) == 0.0);
  CHECK(drive.step(1200ms, 2.0) == 50.0);
  // A moving offset is not followed ...
  for (int i = 1; i <= 10; ++i) CHECK(drive.step(1200ms + i * 100ms, 2.0 + 0.5 * i) == 50.0);
  CHECK(drive.step(3100ms, 7.0) == 50.0);
  CHECK(drive.step(3200ms, 7.0) == 0.0);  // ... but a second after it has stopped
  CHECK(drive.step(3400ms, 7.0) == Approx(50.0 + 50.0 * 5.0 / 23.0));
  // A small change is not followed.
  CHECK(drive.step(9s, 7.1) == drive.step(20s, 7.1));
}

TEST_CASE("a voltage read back after a restart is kept until another offset is commanded",
          "[piezo]") {
  PiezoDrive drive(measured_piezo());
  drive.restart_at(50.0);
  drive.show(0s, 50.0);
  CHECK(drive.obeyed());
  CHECK(drive.applied_um() == 2.0);
  CHECK(drive.step(0s, 2.0) == 50.0);
  CHECK(drive.step(5s, 2.0) == 50.0);
  CHECK(drive.step(6s, 6.6) == 50.0);
  drive.show(6s, 50.0);
  CHECK(drive.applied_um() == 6.6);  // waits for a steady offset, as intended
  CHECK(drive.step(7s, 6.6) == 0.0);
  drive.show(7100ms, 30.0);  // on the way down
  CHECK(drive.obeyed());
  CHECK(drive.applied_um() == 6.6);
  CHECK(drive.step(7200ms, 6.6) == Approx(60.0));
  drive.show(10s, 60.4);
  CHECK(drive.obeyed());
  CHECK(drive.applied_um() == 6.6);
}

TEST_CASE("an amplifier at rest after a restart starts from 0", "[piezo]") {
  PiezoDrive drive(measured_piezo());
  drive.restart_at(0.3);
  drive.show(0s, 0.3);
  CHECK(drive.obeyed());
  CHECK(drive.applied_um() == 0.0);
  CHECK(std::isnan(drive.step(0s, 2.0)));
  drive.show(500ms, 0.3);
  CHECK(drive.applied_um() == 2.0);
  CHECK(drive.step(1s, 2.0) == 0.0);
}

TEST_CASE("an amplifier that does not obey reports the tool's real offset and is driven again",
          "[piezo]") {
  PiezoDrive drive(measured_piezo());
  drive.restart_at(50.0);
  CHECK(drive.step(0s, 2.0) == 50.0);
  const auto [shown_V, applied_um] =
      GENERATE(table<double, double>({{20.0, -12.0}, {0.2, 0.0}, {51.1, 2.506}, {400.0, 25.0}}));
  drive.show(10s, shown_V);
  CHECK_FALSE(drive.obeyed());
  CHECK(drive.applied_um() == Approx(applied_um));
  CHECK(drive.step(10s, 2.0) == 0.0);  // steady for long
  drive.show(10100ms, shown_V);
  CHECK(drive.step(10200ms, 2.0) == 50.0);
  drive.show(10300ms, shown_V);
  CHECK(drive.obeyed() == (shown_V < 1.0));  // at 0 V it showed its setpoint
  CHECK(drive.step(10800ms, 2.0) == 50.0);   // it gets time ...
  drive.show(10900ms, shown_V);
  CHECK(drive.step(10900ms, 2.0) == 0.0);  // ... and another attempt
  CHECK(drive.step(11100ms, 2.0) == 50.0);
  drive.show(11300ms, 50.0);  // it obeys again, but not from 0 V
  CHECK(drive.obeyed());
  CHECK(drive.applied_um() == 2.0);
  CHECK(drive.step(11300ms, 2.0) == 0.0);
}

TEST_CASE("a voltage is not counted as reached from 0 V after a lost link", "[piezo]") {
  PiezoDrive drive(measured_piezo());
  drive.restart_at(50.0);
  CHECK(drive.step(0s, 2.0) == 50.0);
  drive.show(10s, 20.0);  // it does not obey
  CHECK_FALSE(drive.obeyed());
  drive.restart_at(50.0);  // it obeys again; the link was away
  drive.show(11s, 50.0);
  CHECK(drive.obeyed());
  CHECK(drive.step(11s, 2.0) == 50.0);
  CHECK(drive.step(13s, 2.0) == 0.0);
  CHECK(drive.step(14s, 2.0) == 50.0);
  drive.restart_at(50.0);  // now reached from 0 V
  CHECK(drive.step(15s, 2.0) == 50.0);
  CHECK(drive.step(17s, 2.0) == 50.0);
  CHECK(drive.step(18s, 6.6) == 50.0);
  CHECK(drive.step(20s, 6.6) == 0.0);
  drive.restart_at(40.0);  // on the way down
  CHECK(drive.step(21s, 6.6) == 40.0);
  CHECK(drive.step(23s, 6.6) == 0.0);
}

TEST_CASE("a voltage that is NaN gives no offset", "[piezo]") {
  PiezoDrive drive(measured_piezo());
  drive.restart_at(not_a_number);
  CHECK(std::isnan(drive.step(0s, 2.0)));
  drive.show(0s, not_a_number);
  CHECK_FALSE(drive.obeyed());
  CHECK(std::isnan(drive.applied_um()));
}

TEST_CASE("without return to zero the voltage changes directly", "[piezo]") {
  PiezoConfig config = measured_piezo();
  config.return_to_zero = false;
  config.steady_s = 0.0;
  PiezoDrive drive(config);
  CHECK(drive.step(0s, 2.0) == 50.0);
  CHECK(drive.step(100ms, -12.0) == 20.0);
}

TEST_CASE("the voltage stays within the curve for any offset", "[piezo][property]") {
  const auto seed = GENERATE(range(0u, 20u));
  std::mt19937_64 engine(seed);
  PiezoDrive drive(measured_piezo());
  nanoseconds now{};
  for (int i = 0; i < 2000; ++i) {
    now += std::chrono::milliseconds(engine() % 400);
    const double asked[]{static_cast<double>(engine() % 200) - 100.0, not_a_number, INFINITY, 3.0};
    const double shown[]{0.0, 50.0, 1e6, -3.0, not_a_number};
    if (engine() % 97 == 0) drive.restart();
    if (engine() % 89 == 0) drive.restart_at(shown[engine() % 5]);
    if (engine() % 7 == 0) drive.show(now, shown[engine() % 5]);
    const double volt = drive.step(now, asked[engine() % 4]);
    if (!std::isnan(volt)) CHECK((volt >= 0.0 && volt <= 100.0));
  }
}
