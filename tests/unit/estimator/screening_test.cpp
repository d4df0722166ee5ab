#include "estimator/sensing/screening.hpp"

#include <limits>

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

ScreeningConfig plain() {
  ScreeningConfig config;
  config.temp_degC_min = 0;
  config.temp_degC_max = 100;
  config.stale_after_s = 5;
  config.rate_K_per_s_max = 0.5;
  config.rate_allowance_K = 1;
  return config;
}

bool look(Screening& screening, nanoseconds at, double temp_degC) {
  return screening.look(at, {temp_degC, at, Fault::none});
}

}  // namespace

TEST_CASE("nothing is usable before the first good reading", "[screening]") {
  Screening screening(plain());
  CHECK_FALSE(screening.look(0s, Reading{}));
  CHECK_FALSE(screening.usable(0s));
  CHECK(screening.fault(0s) == Fault::never_read);
  CHECK(screening.rejected() == 0);
  CHECK(look(screening, 1s, 20.0));
  CHECK(screening.usable(1s));
  CHECK(screening.fault(1s) == Fault::none);
}

TEST_CASE("every fault of a driver refuses the reading; the next good one is taken",
          "[screening]") {
  for (std::size_t code = 2; code < faults_count; ++code) {
    const auto fault = static_cast<Fault>(code);
    CAPTURE(to_string(fault));
    Screening screening(plain());
    look(screening, 1s, 20.0);
    CHECK_FALSE(screening.look(2s, {20.0, 2s, fault}));
    CHECK(screening.fault(2s) == fault);
    CHECK(screening.good_degC() == 20.0);
    CHECK(screening.good_at() == 1s);
    CHECK(screening.usable(2s));  // the last good one serves until it is stale
    CHECK(screening.usable(6s));
    CHECK_FALSE(screening.usable(6s + 1ns));
    CHECK(screening.rejected() == 1);
    CHECK(look(screening, 7s, 20.5));
    CHECK(screening.fault(7s) == Fault::none);
    CHECK(screening.usable(7s));
  }
}

TEST_CASE("a reading outside the range or not a number is refused", "[screening]") {
  for (const double value :
       {-0.001, 100.001, not_a_number, std::numeric_limits<double>::infinity(), -1e300}) {
    CAPTURE(value);
    Screening screening(plain());
    CHECK_FALSE(look(screening, 1s, value));
    CHECK(screening.fault(1s) == Fault::out_of_range);
    CHECK_FALSE(screening.usable(1s));
  }
  Screening edges(plain());
  CHECK(look(edges, 1s, 0.0));
  Screening upper(plain());
  CHECK(look(upper, 1s, 100.0));
}

TEST_CASE("a reading is judged once", "[screening]") {
  Screening screening(plain());
  CHECK(look(screening, 1s, 20.0));
  CHECK_FALSE(screening.look(2s, {20.0, 1s, Fault::none}));
  CHECK_FALSE(screening.look(3s, {55.0, 1s, Fault::none}));
  CHECK(screening.good_degC() == 20.0);
  CHECK(screening.rejected() == 0);
}

TEST_CASE("a reading that is not renewed becomes stale, and fresh again when it is",
          "[screening]") {
  Screening screening(plain());
  look(screening, 1s, 20.0);
  CHECK(screening.fault(6s) == Fault::none);
  CHECK(screening.fault(6s + 1ns) == Fault::stale);
  CHECK_FALSE(screening.usable(6s + 1ns));
  CHECK(look(screening, 10s, 20.1));
  CHECK(screening.usable(10s));
  CHECK(screening.fault(10s) == Fault::none);
}

TEST_CASE("a reading that is old when it arrives is stale", "[screening]") {
  Screening screening(plain());
  CHECK_FALSE(screening.look(10s, {20.0, 4s, Fault::none}));
  CHECK(screening.fault(10s) == Fault::stale);
  CHECK(screening.look(10s, {20.0, 5s, Fault::none}));
}

TEST_CASE("a reading from the future is stale and does not shut out the ones that follow",
          "[screening]") {
  Screening screening(plain());
  look(screening, 1s, 20.0);
  CHECK_FALSE(screening.look(2s, {20.0, 3600s, Fault::none}));
  CHECK(screening.fault(2s) == Fault::stale);
  CHECK(look(screening, 3s, 20.0));
  CHECK_FALSE(screening.look(4s, {20.0, nanoseconds::max(), Fault::none}));
  CHECK_FALSE(screening.look(4s, {20.0, nanoseconds::min(), Fault::none}));
  // Taken while the cycle was beginning: a little ahead is natural.
  CHECK(screening.look(5s, {20.0, 5s + 1ms, Fault::none}));
}

TEST_CASE("a reading that comes out of order says nothing new", "[screening]") {
  Screening screening(plain());
  look(screening, 3s, 20.0);
  CHECK_FALSE(screening.look(4s, {20.9, 2s, Fault::none}));
  CHECK(screening.fault(4s) == Fault::stale);
  CHECK(screening.good_degC() == 20.0);
  CHECK(look(screening, 5s, 20.2));
  CHECK(screening.fault(5s) == Fault::none);
}

TEST_CASE("a change faster than the structure can is refused; the allowance is on top",
          "[screening]") {
  Screening screening(plain());
  look(screening, 0s, 20.0);
  look(screening, 1s, 20.0);
  CHECK_FALSE(look(screening, 2s, 21.51));
  CHECK(screening.fault(2s) == Fault::too_fast);
  CHECK(screening.good_degC() == 20.0);
  CHECK(look(screening, 3s, 20.0));
  CHECK(look(screening, 4s, 21.5));  // 0.5 K/s x 1 s + 1 K: just allowed
  CHECK(look(screening, 5s, 20.0));  // and downwards
  CHECK_FALSE(look(screening, 6s, 18.4));
}

TEST_CASE("a true step is believed as soon as the structure could have made it", "[screening]") {
  Screening screening(plain());
  look(screening, -1s, 20.0);
  look(screening, 0s, 20.0);
  // 5 K: 8 s at 0.5 K/s with 1 K allowed.
  for (int second = 1; second < 8; ++second)
    CHECK_FALSE(look(screening, std::chrono::seconds(second), 25.0));
  CHECK(screening.rejected() == 7);
  CHECK(look(screening, 8s, 25.0));
  CHECK(screening.fault(8s) == Fault::none);
}

TEST_CASE("a first value that the second one contradicts does not outvote all later ones",
          "[screening]") {
  Screening screening(plain());
  CHECK(look(screening, 0s, 95.0));  // a spike: nothing to compare it with
  CHECK_FALSE(look(screening, 1s, 20.0));
  CHECK_FALSE(screening.usable(1s));  // neither is believed
  CHECK(look(screening, 2s, 20.0));
  CHECK(screening.usable(2s));
  CHECK(look(screening, 3s, 20.0));
  CHECK_FALSE(look(screening, 4s, 95.0));
  CHECK(screening.usable(4s));  // now the old one stands
  CHECK(screening.good_degC() == 20.0);
}

TEST_CASE("a false value after an outage does not outvote the ones that follow", "[screening]") {
  Screening screening(plain());
  look(screening, 0s, 20.0);
  look(screening, 1s, 20.0);
  CHECK(look(screening, 200s, 80.0));  // so long after the last one it could be
  CHECK_FALSE(look(screening, 201s, 20.5));
  CHECK_FALSE(screening.usable(201s));
  CHECK_FALSE(look(screening, 202s, 85.0));  // nor is one believed that nothing agrees with
  CHECK_FALSE(look(screening, 203s, 20.5));
  CHECK(look(screening, 204s, 20.5));
  CHECK(screening.usable(204s));
  CHECK_FALSE(look(screening, 205s, 80.0));
  CHECK(screening.good_degC() == 20.5);
  CHECK(screening.rejected() == 4);
}

TEST_CASE("a true step during an outage is believed with its second reading", "[screening]") {
  Screening screening(plain());
  look(screening, 0s, 20.0);
  look(screening, 1s, 20.0);
  CHECK(look(screening, 200s, 80.0));
  CHECK(look(screening, 201s, 80.0));
  CHECK_FALSE(look(screening, 202s, 20.0));
  CHECK(screening.usable(202s));
  CHECK(screening.good_degC() == 80.0);
}

TEST_CASE("the very same value for too long is a fault until it moves", "[screening]") {
  ScreeningConfig config = plain();
  config.stuck_after_s = 10;
  Screening screening(config);
  for (int second = 0; second <= 10; ++second)
    CHECK(look(screening, std::chrono::seconds(second), 20.0));
  CHECK_FALSE(look(screening, 11s, 20.0));
  CHECK(screening.fault(11s) == Fault::stuck);
  CHECK_FALSE(look(screening, 12s, 20.0));
  CHECK(look(screening, 13s, 20.0000001));
  CHECK(screening.fault(13s) == Fault::none);
  for (int second = 14; second <= 23; ++second)
    CHECK(look(screening, std::chrono::seconds(second), 20.0000001));
  CHECK_FALSE(look(screening, 24s, 20.0000001));
}

TEST_CASE("without stuck_after_s the same value is good for ever", "[screening]") {
  Screening screening(plain());
  for (int second = 0; second <= 5000; ++second)
    REQUIRE(look(screening, std::chrono::seconds(second), 20.0));
}

TEST_CASE("after a reload the new rules judge by the old past", "[screening]") {
  Screening before(plain());
  look(before, 1s, 20.0);
  ScreeningConfig narrow = plain();
  narrow.temp_degC_max = 30;
  Screening after(narrow);
  after.adopt(before);
  CHECK(after.usable(2s));
  CHECK_FALSE(look(after, 2s, 22.0));
  CHECK(after.fault(2s) == Fault::too_fast);
  CHECK_FALSE(look(after, 3s, 31.0));
  CHECK(after.fault(3s) == Fault::out_of_range);
  CHECK(look(after, 4s, 20.5));
}
