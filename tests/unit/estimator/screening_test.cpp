#include <limits>

#include <catch2/catch.hpp>

#include "estimator/sensing/sensor.hpp"

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
  config.settle_s = 0;
  return config;
}

ScreeningConfig settling() {
  ScreeningConfig config = plain();
  config.settle_s = 10;
  return config;
}

bool look(Screening& screening, nanoseconds at, double temp_degC) {
  return screening.step(at, {temp_degC, at, Fault::none});
}

/// Once per second in [from, to). @return number of confirmed values
int look_each_second(Screening& screening, std::chrono::seconds from, std::chrono::seconds to,
                     double temp_degC) {
  int counted = 0;
  for (auto at = from; at < to; at += 1s) counted += look(screening, at, temp_degC) ? 1 : 0;
  return counted;
}

}  // namespace

TEST_CASE("nothing is usable before the first good reading", "[screening]") {
  Screening screening(plain());
  CHECK_FALSE(screening.step(0s, Reading{}));
  CHECK_FALSE(screening.usable(0s));
  CHECK(screening.fault(0s) == Fault::never_read);
  CHECK(screening.rejected() == 0);
  CHECK(look(screening, 1s, 20.0));
  CHECK(screening.usable(1s));
  CHECK(screening.fault(1s) == Fault::none);
}

TEST_CASE("every fault of a driver refuses the reading; the next good one is accepted",
          "[screening]") {
  for (std::size_t code = 2; code < faults_count; ++code) {
    const auto fault = static_cast<Fault>(code);
    CAPTURE(to_string(fault));
    Screening screening(plain());
    look(screening, 1s, 20.0);
    CHECK_FALSE(screening.step(2s, {20.0, 2s, fault}));
    CHECK(screening.fault(2s) == fault);
    CHECK(screening.good_degC() == 20.0);
    CHECK(screening.good_at() == 1s);
    CHECK(screening.usable(2s));  // the last good one is used until it is stale
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
  CHECK_FALSE(screening.step(2s, {20.0, 1s, Fault::none}));
  CHECK_FALSE(screening.step(3s, {55.0, 1s, Fault::none}));
  CHECK(screening.good_degC() == 20.0);
  CHECK(screening.rejected() == 0);
}

TEST_CASE("a reading that is not renewed becomes stale, and fresh when renewed", "[screening]") {
  Screening screening(plain());
  look(screening, 1s, 20.0);
  CHECK(screening.fault(6s) == Fault::none);
  CHECK(screening.fault(6s + 1ns) == Fault::stale);
  CHECK_FALSE(screening.usable(6s + 1ns));
  CHECK(look(screening, 10s, 20.1));
  CHECK(screening.usable(10s));
  CHECK(screening.fault(10s) == Fault::none);
}

TEST_CASE("a reading from the future is stale and does not block the following ones",
          "[screening]") {
  Screening screening(plain());
  look(screening, 1s, 20.0);
  CHECK_FALSE(screening.step(2s, {20.0, 3600s, Fault::none}));
  CHECK(screening.fault(2s) == Fault::stale);
  CHECK(look(screening, 3s, 20.0));
  CHECK_FALSE(screening.step(4s, {20.0, nanoseconds::max(), Fault::none}));
  CHECK_FALSE(screening.step(4s, {20.0, nanoseconds::min(), Fault::none}));
  // Taken during the start of the cycle: slightly ahead is normal.
  CHECK(screening.step(5s, {20.0, 5s + 1ms, Fault::none}));
}

TEST_CASE("a reading out of order has no new information", "[screening]") {
  Screening screening(plain());
  look(screening, 3s, 20.0);
  CHECK_FALSE(screening.step(4s, {20.9, 2s, Fault::none}));
  CHECK(screening.fault(4s) == Fault::stale);
  CHECK(screening.good_degC() == 20.0);
  CHECK(look(screening, 5s, 20.2));
  CHECK(screening.fault(5s) == Fault::none);
}

TEST_CASE("a change faster than the structure can is refused; the allowance is added",
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

TEST_CASE("a lasting step stays refused, however long it lasts", "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  REQUIRE(screening.good_degC() == 22.0);
  const double step_K = GENERATE(3.0, -19.8, 49.6);
  CHECK(look_each_second(screening, 20s, 20s + 48h, 22.0 + step_K) == 0);
  CHECK(screening.fault(20s + 48h) == Fault::unconfirmed);
  CHECK_FALSE(screening.usable(20s + 48h));
  CHECK(screening.jumped());
  CHECK(screening.jump_K() == Approx(step_K));
  CHECK(screening.jumped_at() == 20s);
}

TEST_CASE("a step that a module shows late is followed within two seconds", "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 20.0);
  CHECK(look_each_second(screening, 20s, 30s, 22.0) > 0);
}

TEST_CASE("a step is too_fast while the value before it is in use, and then unconfirmed",
          "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  look(screening, 20s, 30.0);
  CHECK(screening.fault(20s) == Fault::too_fast);
  CHECK(screening.usable(20s));
  look_each_second(screening, 21s, 26s, 30.0);
  CHECK(screening.fault(25s) == Fault::unconfirmed);
  CHECK_FALSE(screening.usable(25s));
}

TEST_CASE("a spike needs no settling; the end of a long fault does", "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  look(screening, 20s, 71.6);
  CHECK(look(screening, 21s, 22.0));
  look_each_second(screening, 22s, 100s, 71.6);
  CHECK(look_each_second(screening, 100s, 110s, 22.4) == 0);
  CHECK(screening.fault(109s) == Fault::unconfirmed);
  CHECK(look(screening, 110s, 22.4));
  CHECK_FALSE(screening.jumped());
  CHECK_FALSE(screening.refuted());
}

TEST_CASE("a return after hours may miss by 10 K/h, but not by more than a quarter of the jump",
          "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  look_each_second(screening, 20s, 20s + 1h, 71.6);
  SECTION("the machine has warmed") {
    CHECK(look_each_second(screening, 20s + 1h, 40s + 1h, 32.0) > 0);
  }
  SECTION("faster than a machine warms") {
    CHECK(look_each_second(screening, 20s + 1h, 40s + 1h, 33.9) == 0);
  }
  SECTION("from one false value to another one") {
    look_each_second(screening, 20s + 1h, 20s + 24h, 71.6);
    CHECK(look_each_second(screening, 20s + 24h, 60s + 24h, 2.2) == 0);
  }
}

TEST_CASE("missing readings during a jump widen the allowed range, the jump does not",
          "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  look_each_second(screening, 20s, 80s, 30.0);
  CHECK(look_each_second(screening, 80s, 200s, 27.0) == 0);
  // 10 s without a reading: 5 K.
  CHECK(look_each_second(screening, 210s, 220s, 27.0) == 0);
  CHECK(look(screening, 220s, 27.0));
}

TEST_CASE("over an outage the structure changes by outage_K_max and 10 K/h at most",
          "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  SECTION("8 K in 20 minutes count after settling") {
    CHECK(look_each_second(screening, 1219s, 1229s, 30.0) == 0);
    CHECK(screening.fault(1228s) == Fault::unconfirmed);
    CHECK_FALSE(screening.jumped());
    CHECK(look(screening, 1229s, 30.0));
    CHECK(screening.fault(1229s) == Fault::none);
  }
  SECTION("14 K in 20 minutes count, 15 K do not") {
    CHECK(look_each_second(screening, 1219s, 1240s, 36.2) > 0);
    CHECK(look_each_second(screening, 2439s, 2500s, 51.4) == 0);
    CHECK(screening.jumped());
  }
  SECTION("degF after 70 s do not") {
    CHECK(look_each_second(screening, 89s, 3600s, 71.6) == 0);
  }
}

TEST_CASE("a first value is confirmed after the settling time, and only if it lasts",
          "[screening]") {
  Screening screening(settling());
  CHECK(look_each_second(screening, 0s, 8s, 85.0) == 0);
  CHECK(screening.fault(7s) == Fault::unconfirmed);
  CHECK(screening.waiting());
  CHECK_FALSE(screening.jumped());
  CHECK(screening.rejected() == 0);
  CHECK(look_each_second(screening, 8s, 18s, 23.3) == 0);
  CHECK(look(screening, 18s, 23.3));
  CHECK(screening.usable(18s));
  CHECK(screening.good_degC() == 23.3);
}

TEST_CASE("two equal readings are not enough at any interval", "[screening]") {
  ScreeningConfig config = settling();
  config.stale_after_s = 120;
  Screening screening(config);
  CHECK_FALSE(look(screening, 0s, 20.0));
  CHECK_FALSE(look(screening, 60s, 20.0));
  CHECK(look(screening, 120s, 20.0));
}

TEST_CASE("an exact zero never settles by itself", "[screening]") {
  ScreeningConfig config = settling();
  config.temp_degC_min = -30;
  Screening at_start(config);
  CHECK(look_each_second(at_start, 0s, 600s, 0.0) == 0);
  CHECK(look_each_second(at_start, 600s, 611s, 23.3) == 1);
  // After an outage that is long enough for it.
  Screening under_way(config);
  look_each_second(under_way, 0s, 20s, 9.0);
  CHECK(look_each_second(under_way, 90s, 135s, 0.0) == 0);
  CHECK(look_each_second(under_way, 135s, 146s, 9.0) == 1);
  // What a raw 0 means where the module is set to 0.1 degF.
  config.raw_0_degC = -17.78;
  Screening in_degF(config);
  CHECK(look_each_second(in_degF, 0s, 600s, -17.78) == 0);
  // A course through zero does.
  Screening cooling(config);
  look_each_second(cooling, 0s, 20s, 0.4);
  CHECK(look(cooling, 20s, 0.0));
}

TEST_CASE("the neighbours' expectation confirms a jump and refutes the value before it",
          "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  const auto expect = [&](double degC, double sd_K) { screening.expect({degC, sd_K, false}); };
  SECTION("where they are sure and agree") {
    expect(27.5, 0.4);
    CHECK(look_each_second(screening, 20s, 30s, 28.0) == 0);
    CHECK(look(screening, 30s, 28.0));
    CHECK(screening.refuted());
    CHECK(look(screening, 31s, 28.0));
    CHECK_FALSE(screening.refuted());
  }
  SECTION("not where they are not sure") {
    expect(27.5, 0.6);
    CHECK(look_each_second(screening, 20s, 60s, 28.0) == 0);
  }
  SECTION("not where they do not agree") {
    expect(25.0, 0.1);
    CHECK(look_each_second(screening, 20s, 60s, 28.0) == 0);
  }
  SECTION("a value that the past allows after an outage must agree too") {
    expect(22.5, 0.2);
    CHECK(look_each_second(screening, 90s, 120s, 28.0) == 0);
    CHECK(screening.jumped());
    CHECK(screening.jump_K() == Approx(5.5));
    expect(27.0, 0.2);
    CHECK(look(screening, 120s, 28.0));
  }
}

TEST_CASE("an expectation does not apply after the next outage", "[screening]") {
  Screening screening(settling());
  look_each_second(screening, 0s, 20s, 22.0);
  screening.expect({22.0, 0.1, false});
  CHECK(look_each_second(screening, 90s, 101s, 22.3) == 1);
  CHECK(look_each_second(screening, 300s, 311s, 29.0) == 1);
}

TEST_CASE("a module that is not ready does not settle", "[screening]") {
  Screening screening(settling());
  screening.expect({not_a_number, 0.0, true});
  CHECK(look_each_second(screening, 0s, 60s, 25.0) == 0);
  screening.expect({});
  CHECK(look(screening, 60s, 25.0));
}

TEST_CASE("an operator accepts a waiting value, and only that", "[screening]") {
  Screening screening(settling());
  CHECK_FALSE(screening.accept());
  look(screening, 0s, 20.0);
  CHECK(screening.accept());
  CHECK(screening.usable(0s));
  CHECK_FALSE(screening.refuted());
  CHECK_FALSE(screening.accept());
  look_each_second(screening, 1s, 20s, 23.0);
  REQUIRE(screening.jumped());
  CHECK(screening.accept());
  CHECK(screening.refuted());
  CHECK(screening.good_degC() == 23.0);
  CHECK(screening.fault(19s) == Fault::none);
  CHECK(look(screening, 20s, 23.1));
}

TEST_CASE("settle_s = 0: the first value counts at once, also after an outage", "[screening]") {
  Screening screening(plain());
  CHECK(look(screening, 0s, 0.0));
  CHECK(look(screening, 200s, 10.0));
}

TEST_CASE("an unchanged value is a fault after stuck_after_s, until it changes", "[screening]") {
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

TEST_CASE("after a reload the new limits apply to the old state", "[screening]") {
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
