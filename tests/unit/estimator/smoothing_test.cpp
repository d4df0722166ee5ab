#include <array>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/sensing/sensor.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

SmoothingConfig config_of(SmoothingForm form, SmoothingHistory history, double period_s) {
  SmoothingConfig config;
  config.form = form;
  config.history = history;
  config.period_s = period_s;
  config.samples = 6;
  config.half_width_K = 0.3;
  config.outage_s = 300;
  return config;
}

SmoothingConfig form_a(SmoothingHistory history) {
  return config_of(SmoothingForm::sliding_line, history, 60);
}
SmoothingConfig form_b(SmoothingHistory history) {
  return config_of(SmoothingForm::line_of_lines, history, 20);
}

/// A smoother with one value per pitch, from time 0.
struct Fed {
  explicit Fed(const SmoothingConfig& config)
      : pitch(std::chrono::duration_cast<nanoseconds>(seconds_d(config.period_s))),
        smoother(config) {}
  double operator()(double value_K) {
    smoother.add({next, value_K});
    next += pitch;
    return smoother.value_K();
  }
  nanoseconds pitch;
  nanoseconds next{};
  Smoother smoother;
};

double added(Smoother& smoother, nanoseconds at, double value_K) {
  smoother.add({at, value_K});
  return smoother.value_K();
}

Approx near(double value) {
  return Approx(value).margin(1e-12).epsilon(1e-12);
}

}  // namespace

TEST_CASE("form A passes everything through until n values are stored", "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::raw));
  CHECK_FALSE(feed.smoother.has_value());
  for (const double value : {0.0, 5.0, -3.0, 7.0, 0.0, 40.0}) CHECK(feed(value) == value);
  CHECK(feed.smoother.clipped() == 0);
}

TEST_CASE("form A passes a value inside the band and on its edge, clips it beyond", "[smoothing]") {
  for (const auto& [value, expected, clipped] :
       std::vector<std::tuple<double, double, unsigned>>{{0.0, 0.0, 0},
                                                         {0.29, 0.29, 0},
                                                         {-0.29, -0.29, 0},
                                                         {0.3, 0.3, 0},
                                                         {-0.3, -0.3, 0},
                                                         {std::nextafter(0.3, 1.0), 0.3, 1},
                                                         {0.31, 0.3, 1},
                                                         {-0.31, -0.3, 1},
                                                         {50.0, 0.3, 1},
                                                         {-50.0, -0.3, 1}}) {
    CAPTURE(value);
    Fed feed(form_a(SmoothingHistory::raw));
    for (int i = 0; i < 6; ++i) feed(0.0);
    CHECK(feed(value) == expected);
    CHECK(feed.smoother.clipped() == clipped);
    CHECK(feed.smoother.clipped_in_a_row() == clipped);
  }
}

TEST_CASE("form A, raw history: a 3 K spike comes out as 0.3, then lets 1.7, 1.1, 0.5 through",
          "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::raw));
  for (int i = 0; i < 6; ++i) feed(0.0);
  CHECK(feed(3.0) == near(0.3));
  CHECK(feed(0.0) == near(1.7));
  CHECK(feed(0.0) == near(1.1));
  CHECK(feed(0.0) == near(0.5));
  // Spike at place 3 of 6: slope -0.5 x 3 / 17.5, expected 0.5 - 0.3 = 0.2: zero is inside again.
  CHECK(feed(0.0) == 0.0);
  CHECK(feed.smoother.clipped() == 4);
  CHECK(feed.smoother.clipped_in_a_row() == 0);
}

TEST_CASE("form A, screened history: a 3 K spike comes out as 0.3 and leaves nothing behind",
          "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) feed(0.0);
  CHECK(feed(3.0) == 0.3);
  CHECK(feed.smoother.clipped_in_a_row() == 1);
  for (int i = 0; i < 8; ++i) CHECK(feed(0.0) == 0.0);
  CHECK(feed.smoother.clipped() == 1);
  CHECK(feed.smoother.clipped_in_a_row() == 0);
}

TEST_CASE("form A, raw history: a genuine step is followed, overshooting by hand-computed amounts",
          "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::raw));
  for (int i = 0; i < 6; ++i) feed(0.0);
  CHECK(feed(5.0) == near(0.3));
  CHECK(feed(5.0) == near(10.0 / 3 + 0.3));  // 0 0 0 0 0 5 -> 10/3
  CHECK(feed(5.0) == near(17.0 / 3 - 0.3));  // 0 0 0 0 5 5 -> 5/3 + 3.5 x 20/17.5 = 17/3
  CHECK(feed(5.0) == near(7.0 - 0.3));       // 0 0 0 5 5 5 -> 2.5 + 3.5 x 22.5/17.5 = 7
  CHECK(feed(5.0) == near(22.0 / 3 - 0.3));  // 0 0 5 5 5 5 -> 10/3 + 4
  CHECK(feed(5.0) == near(20.0 / 3 - 0.3));  // 0 5 5 5 5 5 -> 25/6 + 2.5
  CHECK(feed(5.0) == 5.0);
}

TEST_CASE("form A, screened history: a genuine step is accepted after three agreeing values",
          "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) feed(0.0);
  CHECK(feed(5.0) == 0.3);
  CHECK(feed(5.1) == 0.3);
  CHECK(feed(5.0) == 5.0);
  // The history restarted with the three, so nothing is clipped until six are stored.
  CHECK(feed(5.2) == 5.2);
  CHECK(feed(4.9) == 4.9);
  CHECK(feed(5.0) == 5.0);
  CHECK(feed(9.0) < 5.5);
}

TEST_CASE("a screened history follows a course so steep that its values are far apart",
          "[smoothing]") {
  for (const auto& config :
       {form_a(SmoothingHistory::screened), form_b(SmoothingHistory::screened)}) {
    Fed feed(config);
    for (int i = 0; i < 18; ++i) feed(20.0);
    double value_K = 20.0;
    for (int i = 1; i <= 3; ++i) value_K = feed(20.0 + 2.0 * i);  // 0.9 K is already far
    CHECK(value_K == 26.0);
    for (int i = 4; i <= 12; ++i) CHECK(feed(20.0 + 2.0 * i) == near(20.0 + 2.0 * i));
  }
}

TEST_CASE("far values that do not agree never enter a screened history", "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) feed(0.0);
  for (const double value : {5.0, -5.0, 8.0, 2.0, -9.0, 4.0, -3.0})
    CHECK(std::abs(feed(value)) == near(0.3));
  CHECK(feed.smoother.clipped_in_a_row() == 7);
  CHECK(feed(0.0) == 0.0);
}

TEST_CASE("three agreeing values are accepted after a stray one", "[smoothing]") {
  Fed feed(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) feed(0.0);
  CHECK(feed(-8.0) == near(-0.3));
  CHECK(feed(5.0) == 0.3);
  CHECK(feed(5.0) == 0.3);
  CHECK(feed(5.0) == 5.0);
}

TEST_CASE("a value outside the band but not far enters a screened history", "[smoothing]") {
  // 0.9 K is three half-widths: the last value kept. It raises the next expectation to 0.6.
  Fed kept(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) kept(0.0);
  CHECK(kept(0.89) == 0.3);
  CHECK(kept(0.0) == near(0.89 * 2 / 3 - 0.3));
  Fed refused(form_a(SmoothingHistory::screened));
  for (int i = 0; i < 6; ++i) refused(0.0);
  CHECK(refused(0.91) == 0.3);
  CHECK(refused(0.0) == 0.0);
}

TEST_CASE("the limit of a far value grows with the robust spread of the history", "[smoothing]") {
  // Values +-1 around 0: residuals near 1, so far is about 3 x 1.48 K, and 3 K is not.
  SmoothingConfig config = form_a(SmoothingHistory::screened);
  Fed feed(config);
  for (const double value : {1.0, -1.0, -1.0, -1.0, -1.0, 1.0}) feed(value);
  // By symmetry the line is flat at -1/3: residuals 4/3 and 2/3, median of six (4th) 2/3;
  // far is 3 x 1.4826 x 2/3 = 2.97 K from -1/3.
  CHECK(feed(2.6) == near(-1.0 / 3 + 0.3));
  // Kept: -1 -1 -1 -1 1 2.6 -> mean -0.4/6, extrapolated by 3.5 samples of the slope.
  const double slope = (2.5 + 1.5 + 0.5 - 0.5 + 1.5 * 1.0 + 2.5 * 2.6) / 17.5;
  CHECK(feed(0.0) == near(-0.4 / 6 + 3.5 * slope - 0.3));
}

TEST_CASE("a straight course at irregular times is expected exactly", "[smoothing]") {
  SmoothingConfig config = form_b(SmoothingHistory::raw);
  config.period_s = 0;
  Smoother smoother(config);
  nanoseconds at{};
  for (int i = 0; i < 18; ++i) {
    added(smoother, at, 20.0 + 0.01 * 1e-9 * static_cast<double>(at.count()));
    at += std::chrono::seconds(3 + (i * 7) % 11);
  }
  const double expected_K = 20.0 + 0.01 * 1e-9 * static_cast<double>(at.count());
  CHECK(added(smoother, at, 30.0) == Approx(expected_K + 0.3).margin(1e-9));
}

TEST_CASE("after an outage the history restarts", "[smoothing]") {
  for (const auto& config : {form_a(SmoothingHistory::raw), form_a(SmoothingHistory::screened)}) {
    Smoother smoother(config);
    for (int i = 0; i < 6; ++i) added(smoother, i * 60s, 0.0);
    SECTION("a gap of just outage_s is none") {
      CHECK(added(smoother, 600s, 5.0) == 0.3);
    }
    SECTION("a longer one passes n values through") {
      CHECK(added(smoother, 601s, 5.0) == 5.0);
      for (int i = 1; i < 6; ++i) CHECK(added(smoother, 601s + i * 60s, 5.0 - i) == 5.0 - i);
      CHECK(added(smoother, 601s + 6 * 60s, 20.0) == near(-0.7));
    }
  }
}

TEST_CASE("an outage during form B restarts its blocks", "[smoothing]") {
  Fed feed(form_b(SmoothingHistory::raw));
  for (int i = 0; i < 20; ++i) feed(0.0);
  feed.next += 301s;
  for (int i = 0; i < 18; ++i) CHECK(feed(5.0 + i % 3) == 5.0 + i % 3);
  CHECK(feed(60.0) < 20.0);
}

TEST_CASE("form B passes everything through until three blocks are stored", "[smoothing]") {
  Fed feed(form_b(SmoothingHistory::raw));
  for (int i = 0; i < 18; ++i) CHECK(feed(i * i % 7) == i * i % 7);
  CHECK(feed.smoother.clipped() == 0);
}

TEST_CASE("form B: slopes C, B, A give D = 3A - 3B + C from the newest block's fitted end",
          "[smoothing]") {
  // Blocks with slopes 1, 2, 4 K per sample: D = 12 - 6 + 1 = 7 (per 20 s). Steps between blocks
  // are arbitrary: only slopes and the newest block's end count.
  Fed feed(form_b(SmoothingHistory::raw));
  for (int i = 0; i < 6; ++i) feed(100.0 + 1.0 * i);
  for (int i = 0; i < 6; ++i) feed(50.0 + 2.0 * i);
  for (int i = 0; i < 6; ++i) feed(10.0 + 4.0 * i);
  // The newest block ends at 30; the same line is used for the whole next block.
  for (int i = 1; i <= 6; ++i) CHECK(feed(1000.0) == near(30.0 + 7.0 * i + 0.3));
}

TEST_CASE("form B: the next block uses its own times when samples are missed", "[smoothing]") {
  Smoother smoother(form_b(SmoothingHistory::raw));
  for (int i = 0; i < 18; ++i) added(smoother, i * 20s, 0.1 * i);
  CHECK(added(smoother, 18 * 20s, 9.0) == near(2.1));
  CHECK(added(smoother, 22 * 20s, 9.0) == near(2.5));  // three missed
}

TEST_CASE("form B predicts the slope of a quadratic and of a cubic course exactly", "[smoothing]") {
  for (const double cubic : {0.0, 1e-9}) {
    LineOfLines lines(6, 3);
    const auto course_K = [&](int i) {
      const double time_s = 20.0 * i;
      return 20.0 + 3e-3 * time_s + 2e-6 * time_s * time_s + cubic * time_s * time_s * time_s;
    };
    for (int i = 0; i < 18; ++i) lines.keep({i * 20s, course_K(i)});
    REQUIRE(lines.ready());
    std::vector<Sample> newest;
    std::vector<Sample> coming;
    for (int i = 12; i < 18; ++i) newest.push_back({i * 20s, course_K(i)});
    for (int i = 18; i < 24; ++i) coming.push_back({i * 20s, course_K(i)});
    const Line expected = lines.expected();
    CHECK(expected.slope_K_per_s == Approx(fit_line(coming).slope_K_per_s).epsilon(1e-12));
    CHECK(expected.at(17 * 20s) == near(fit_line(newest).at(17 * 20s)));
  }
}

TEST_CASE("form B, raw history: a spike late in a block throws the next band off by many K",
          "[smoothing]") {
  Fed feed(form_b(SmoothingHistory::raw));
  for (int i = 0; i < 17; ++i) feed(0.0);
  feed(3.0);
  // 0 0 0 0 0 3: slope 3/7 K per sample, fitted end 11/7 K, D = 9/7 K per sample.
  for (int i = 1; i <= 6; ++i) CHECK(feed(0.0) == near((11.0 + 9.0 * i) / 7.0 - 0.3));
}

TEST_CASE("form B, screened history: a spike late in a block leaves the next band where it was",
          "[smoothing]") {
  Fed feed(form_b(SmoothingHistory::screened));
  for (int i = 0; i < 18 + 5; ++i) feed(0.0);
  CHECK(feed(3.0) == 0.3);
  for (int i = 1; i <= 20; ++i) CHECK(feed(0.0) == 0.0);
}

TEST_CASE("form B: a genuine step, raw is followed by the next blocks, screened after three",
          "[smoothing]") {
  Fed raw(form_b(SmoothingHistory::raw));
  Fed screened(form_b(SmoothingHistory::screened));
  for (int i = 0; i < 18; ++i) {
    raw(0.0);
    screened(0.0);
  }
  for (int i = 0; i < 6; ++i) CHECK(raw(5.0) == 0.3);  // the old line is used for the whole block
  CHECK(raw(5.0) == near(5.0));                        // a flat block at 5: D = 0
  CHECK(screened(5.0) == 0.3);
  CHECK(screened(5.0) == 0.3);
  for (int i = 0; i < 20; ++i) CHECK(screened(5.0) == 5.0);
}

TEST_CASE("one value per period is taken on a grid that late samples do not shift", "[smoothing]") {
  SmoothingConfig config = form_a(SmoothingHistory::raw);
  config.period_s = 20;
  config.samples = 32;  // all pass through: value_K() shows which were taken
  Smoother smoother(config);
  CHECK(added(smoother, 0s, 1.0) == 1.0);
  CHECK(added(smoother, 19s, 2.0) == 1.0);
  CHECK(added(smoother, 35s, 3.0) == 3.0);  // 15 s late
  CHECK(added(smoother, 39s, 4.0) == 3.0);
  CHECK(added(smoother, 40s, 5.0) == 5.0);  // the grid is still at 40 s
  CHECK(added(smoother, 95s, 6.0) == 6.0);  // missed 60 and took 80 s late
  CHECK(added(smoother, 99s, 7.0) == 6.0);
  CHECK(added(smoother, 100s, 8.0) == 8.0);
}

TEST_CASE("with period 0 every sample is taken", "[smoothing]") {
  SmoothingConfig config = form_a(SmoothingHistory::raw);
  config.period_s = 0;
  Smoother smoother(config);
  for (int i = 0; i < 6; ++i) CHECK(added(smoother, i * 10ms, 1.0 + i) == 1.0 + i);
}

TEST_CASE("smoothing off passes every value at any time", "[smoothing]") {
  Smoother smoother(config_of(SmoothingForm::off, SmoothingHistory::raw, 60));
  for (int i = 0; i < 20; ++i) CHECK(added(smoother, i * 1s, 7.0 * (i % 3)) == 7.0 * (i % 3));
}

TEST_CASE("a smoother with another's loaded state continues bit for bit", "[smoothing]") {
  for (const auto& config : {form_a(SmoothingHistory::raw), form_a(SmoothingHistory::screened),
                             form_b(SmoothingHistory::raw), form_b(SmoothingHistory::screened)}) {
    Fed one(config);
    Fed other(config);
    const auto value_K = [](int i) { return 20.0 + std::sin(0.3 * i) + (i % 13 == 5 ? 4.0 : 0.0); };
    for (int i = 0; i < 31; ++i) one(value_K(i));
    StateArchive count;
    one.smoother.visit_state(count);
    std::vector<std::byte> bytes(count.position_bytes());
    StateArchive save{std::span<std::byte>(bytes)};
    one.smoother.visit_state(save);
    StateArchive load{std::span<const std::byte>(bytes)};
    other.smoother.visit_state(load);
    other.next = one.next;
    for (int i = 31; i < 100; ++i) CHECK(one(value_K(i)) == other(value_K(i)));
    CHECK(one.smoother.clipped() == other.smoother.clipped());
    CHECK(one.smoother.clipped_in_a_row() == other.smoother.clipped_in_a_row());
  }
}

TEST_CASE("smoothing refuses an impossible configuration", "[smoothing]") {
  const auto broken = [](const char* key, auto change) {
    SmoothingConfig config;
    change(config);
    CHECK_THROWS_WITH(Smoother(config), Catch::Contains(key));
  };
  broken("samples", [](SmoothingConfig& config) { config.samples = 2; });
  broken("samples", [](SmoothingConfig& config) { config.samples = 33; });
  broken("half_width_K", [](SmoothingConfig& config) { config.half_width_K = 0; });
  broken("half_width_K", [](SmoothingConfig& config) { config.half_width_K = not_a_number; });
  broken("period_s", [](SmoothingConfig& config) { config.period_s = -1; });
  broken("outage_s", [](SmoothingConfig& config) { config.outage_s = 0; });
}

TEST_CASE("form B takes one to six blocks, with the slope of the polynomial through theirs",
          "[smoothing]") {
  // By hand, slopes of the blocks in K per value, oldest first: 1, 2, 4. One block: 4; two: 2*4 - 2
  // = 6; three: 3*4 - 3*2 + 1 = 7. The next block starts from 18: 6 + 6*2 at its end.
  for (const auto& [blocks, slope] : {std::pair{1u, 4.0}, std::pair{2u, 6.0}, std::pair{3u, 7.0}}) {
    CAPTURE(blocks);
    LineOfLines lines(3, blocks);
    nanoseconds at{};
    double value_K = 0.0;
    for (const double step : {1.0, 2.0, 4.0}) {
      for (int i = 0; i < 3; ++i, at += 1s, value_K += step) lines.keep({at, value_K});
    }
    REQUIRE(lines.ready());
    const double last_K = value_K - 4.0;
    CHECK(lines.expected().at(at - 1s) == near(last_K));
    CHECK(lines.expected().at(at) == near(last_K + slope));
  }
  LineOfLines four(3, 4);
  for (int i = 0; i < 9; ++i) four.keep({i * 1s, 0.0});
  CHECK_FALSE(four.ready());
}
