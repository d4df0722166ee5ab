#include "drivers/controllers/piezo_drive.hpp"

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

TEST_CASE("the inverted curve gives back every displacement within it", "[piezo]") {
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

TEST_CASE("a new voltage comes after 0 V, once the offset stands still", "[piezo]") {
  PiezoDrive drive(measured_piezo());
  CHECK(std::isnan(drive.step(0s, 2.0)));
  CHECK(std::isnan(drive.step(900ms, 2.0)));
  CHECK(drive.step(1s, 2.0) == 0.0);
  CHECK(drive.step(1100ms, 2.0) == 0.0);
  CHECK(drive.step(1200ms, 2.0) == 50.0);
  // On its way the offset is not followed ...
  for (int i = 1; i <= 10; ++i) CHECK(drive.step(1200ms + i * 100ms, 2.0 + 0.5 * i) == 50.0);
  CHECK(drive.step(3100ms, 7.0) == 50.0);
  CHECK(drive.step(3200ms, 7.0) == 0.0);  // ... but a second after it has arrived
  CHECK(drive.step(3400ms, 7.0) == Approx(50.0 + 50.0 * 5.0 / 23.0));
  // A change too small stays where it is.
  CHECK(drive.step(9s, 7.1) == drive.step(20s, 7.1));
}

TEST_CASE("without returning to zero the voltage goes straight there", "[piezo]") {
  PiezoConfig config = measured_piezo();
  config.return_to_zero = false;
  config.steady_s = 0.0;
  PiezoDrive drive(config);
  CHECK(drive.step(0s, 2.0) == 50.0);
  CHECK(drive.step(100ms, -12.0) == 20.0);
}

TEST_CASE("whatever is asked for, the voltage stays within the curve", "[piezo][property]") {
  const auto seed = GENERATE(range(0u, 20u));
  std::mt19937_64 engine(seed);
  PiezoDrive drive(measured_piezo());
  nanoseconds now{};
  for (int i = 0; i < 2000; ++i) {
    now += std::chrono::milliseconds(engine() % 400);
    const double asked[]{static_cast<double>(engine() % 200) - 100.0, not_a_number, INFINITY, 3.0};
    if (engine() % 97 == 0) drive.restart();
    const double volt = drive.step(now, asked[engine() % 4]);
    if (!std::isnan(volt)) CHECK((volt >= 0.0 && volt <= 100.0));
  }
}
