#include <limits>

#include <catch2/catch.hpp>

#include "estimator/axes/axis_bank.hpp"

using namespace thermocomp;

namespace {
LimiterConfig bounds(double offset_um_max, double rate_um_per_s_max) {
  return {offset_um_max, rate_um_per_s_max};
}
}  // namespace

TEST_CASE("the offset goes to its target at the slew rate and reaches it exactly", "[limiter]") {
  Limiter limiter(bounds(50, 2));
  limiter.step(3.3, 0.5);
  CHECK(limiter.offset_um() == 1.0);
  limiter.step(3.3, 0.5);
  CHECK(limiter.offset_um() == 2.0);
  limiter.step(3.3, 1.0);
  CHECK(limiter.offset_um() == 3.3);
  limiter.step(-10.0, 0.25);
  CHECK(limiter.offset_um() == Approx(2.8));
}

TEST_CASE("the offset stops at its bound and reports it", "[limiter]") {
  Limiter limiter(bounds(5, 100));
  limiter.step(5.0, 1);
  CHECK_FALSE(limiter.at_bound());
  limiter.step(80.0, 1);
  CHECK(limiter.offset_um() == 5.0);
  CHECK(limiter.at_bound());
  limiter.step(-80.0, 1);
  CHECK(limiter.offset_um() == -5.0);
  CHECK(limiter.at_bound());
  limiter.step(0.0, 1);
  CHECK_FALSE(limiter.at_bound());
}

TEST_CASE("a long pause causes no jump: only the longest step counts", "[limiter]") {
  Limiter limiter(bounds(50, 2));
  limiter.step(40.0, 3600.0);
  CHECK(limiter.offset_um() == 2.0);
  Limiter fast({50, 2, 0.02});
  fast.step(40.0, 0.1);
  CHECK(fast.offset_um() == 0.04);
}

TEST_CASE("a time step that is zero, negative or NaN moves nothing", "[limiter]") {
  Limiter limiter(bounds(50, 2));
  for (const double dt_s : {0.0, -1.0, not_a_number}) {
    limiter.step(40.0, dt_s);
    CHECK(limiter.offset_um() == 0.0);
  }
}

TEST_CASE("a non-finite target moves nothing", "[limiter]") {
  Limiter limiter(bounds(50, 2));
  limiter.start_from(7.0);
  for (const double target_um : {not_a_number, std::numeric_limits<double>::infinity(),
                                 -std::numeric_limits<double>::infinity()}) {
    limiter.step(target_um, 1.0);
    CHECK(limiter.offset_um() == 7.0);
  }
}

TEST_CASE("an offset outside the bound returns at the slew rate, with or without a target",
          "[limiter]") {
  Limiter limiter(bounds(10, 2));
  limiter.start_from(15.0);
  limiter.step(40.0, 1.0);
  CHECK(limiter.offset_um() == 13.0);
  limiter.step(not_a_number, 1.0);
  CHECK(limiter.offset_um() == 11.0);
  limiter.step(0.0, 0.25);
  CHECK(limiter.offset_um() == 10.5);
  limiter.step(40.0, 1.0);
  CHECK(limiter.offset_um() == 10.0);
}

TEST_CASE("impossible bounds are refused", "[limiter]") {
  CHECK_THROWS_WITH(Limiter(bounds(0, 1)), Catch::Contains("offset_um_max"));
  CHECK_THROWS_WITH(Limiter(bounds(501, 1)), Catch::Contains("offset_um_max"));
  CHECK_THROWS_WITH(Limiter(bounds(not_a_number, 1)), Catch::Contains("offset_um_max"));
  CHECK_THROWS_WITH(Limiter(bounds(50, 0)), Catch::Contains("rate_um_per_s_max"));
  CHECK_THROWS_WITH(Limiter(bounds(50, not_a_number)), Catch::Contains("rate_um_per_s_max"));
}
