// An axis and its read-backs, on one link and on the next.
#include <algorithm>
#include <array>
#include <cmath>

#include <catch2/catch.hpp>

#include "axis_bench.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace std::chrono_literals;

TEST_CASE("an axis is not driven before the controller has reported its applied offset", "[axis]") {
  Bench bench;
  bench.obeys = false;
  bench.input.online = false;
  bench.steps(5, 30.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 0.0);
  bench.input.online = true;
  bench.input.applied_um = not_a_number;
  bench.steps(5, 30.0);
  CHECK_FALSE(bench.axis().synced());
  bench.input.applied_um = 12.0;
  bench.step(30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(12.2));  // from the applied offset, at the slew rate
}

TEST_CASE("an axis of a link that was never connected is not driven", "[axis]") {
  for (const bool reads_back : {true, false}) {
    Bench bench(reads_back);
    bench.input.link_epoch = 0;
    bench.steps(5, 30.0);
    CHECK_FALSE(bench.axis().driven());
    CHECK(bench.axis().offset_um() == 0.0);
  }
}

TEST_CASE("a new link starts from the read-back, not from the offset sent", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  REQUIRE(bench.axis().offset_um() == 10.0);
  bench.input.online = false;
  bench.input.link_epoch = 2;
  bench.step(10.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);
  bench.obeys = false;
  bench.input.online = true;
  bench.input.applied_um = 3.0;
  bench.step(10.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(3.2));
  CHECK_FALSE(bench.axis().mismatch());
}

TEST_CASE("an old read-back on a new link does not set the offset back", "[axis]") {
  Bench bench;
  bench.steps(50, 30.0);
  const double sent_um = bench.axis().offset_um();
  bench.obeys = false;
  bench.input.link_epoch = 2;
  bench.input.applied_um = sent_um - 1.0;  // half a second ago
  bench.step(30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == sent_um);
  bench.obeys = true;
  bench.steps(4, 30.0);
  CHECK(bench.axis().offset_um() > sent_um);
  bench.obeys = false;
  bench.input.link_epoch = 3;
  bench.input.applied_um = 0.0;  // restarted
  bench.step(30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(0.2));
}

TEST_CASE("an implausible read-back on a new link ages the offsets sent too", "[axis]") {
  Bench bench;
  bench.steps(20, 40.0);  // from 0.2 to 4 um within the window
  const double sent_um = bench.axis().offset_um();
  bench.obeys = false;
  bench.input.link_epoch = 2;
  bench.input.applied_um = -81.0;
  bench.steps(600, 40.0);
  bench.input.applied_um = 1.2;
  int steps = 0;
  while (!bench.axis().driven() && steps++ < 100) bench.step(40.0);
  CHECK(sent_um > 3.0);
  CHECK(bench.axis().offset_um() < 2.0);
}

TEST_CASE("an axis that a new link finds on its way back starts from there", "[axis]") {
  Bench bench;
  bench.steps(145, 30.0);  // the last offsets are on the way
  const double sent_um = bench.axis().offset_um();
  bench.obeys = false;
  bench.input.link_epoch = 2;
  bench.input.applied_um = not_a_number;
  for (int i = 0; i < 16; ++i) bench.step(30.0);
  bench.input.link_epoch = 3;
  bench.input.applied_um = 0.9 * sent_um;
  bench.step(30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(0.9 * sent_um + 0.2));
}

TEST_CASE("one unexplained read-back pauses the axis, which continues from its own offset",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = -40.0;
  bench.step(12.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);
  bench.input.applied_um = 10.0;
  bench.step(12.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(10.2));
  bench.input.applied_um = -40.0;  // once more, soon after: latched
  bench.step(12.0);
  CHECK(bench.axis().latched());
}

TEST_CASE("a pause of the same link does not change the offset", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.input.link_epoch += epochs_of_a_link;
  bench.obeys = false;
  bench.input.applied_um = 9.1;  // within the tolerance
  bench.steps(2, 12.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);  // until a command of the new epoch is written
  bench.step(12.0);
  CHECK(bench.axis().offset_um() == Approx(10.2));
}

TEST_CASE("a controller that refuses offsets gets no accumulated offset later", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  for (int i = 0; i < 100; ++i) {
    bench.input.link_epoch += epochs_of_a_link;
    bench.steps(2, 40.0);
  }
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);
}

TEST_CASE("a new link that shows neither the offset sent nor less of it is refused", "[axis]") {
  for (const double applied_um : {20.0, -10.0, 13.0}) {
    Bench bench;
    bench.steps(100, 10.0);
    bench.obeys = false;
    bench.input.link_epoch = 2;
    bench.input.applied_um = applied_um;
    bench.step(10.0);
    CHECK_FALSE(bench.axis().driven());
    bench.step(10.0);
    CHECK(bench.axis().latched());
    CHECK(bench.axis().offset_um() == 10.0);
  }
}

TEST_CASE("after a disagreement an old read-back does not start an axis", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.step(10.0);
  const nanoseconds taken_at = bench.input.taken_at;
  for (int i = 0; i < 20; ++i) {  // the same read-back again and again
    bench.input.now += 100ms;
    bench.input.taken_at = taken_at;
    bench.read_back();
    CHECK_FALSE(bench.axis().driven());
  }
}

TEST_CASE("a late read-back of an offset sent is no mismatch", "[axis]") {
  Bench bench;
  bench.steps(50, 5.0);
  bench.obeys = false;  // the read-back stays while the offset moves
  const double before_um = bench.axis().offset_um();
  for (int i = 0; i < 20; ++i) bench.step(20.0);
  CHECK_FALSE(bench.axis().mismatch());
  CHECK(bench.axis().offset_um() > before_um + 3.9);
}

TEST_CASE("a controller that ignores offsets becomes a mismatch", "[axis]") {
  Bench bench;
  bench.steps(10, 0.0);
  bench.obeys = false;
  bench.steps(60, 50.0);
  CHECK(bench.axis().latched());
  CHECK(bench.axis().offset_um() < 50.0);
}

namespace {

/// An offset that swings by +-1.9 um within 40 s; the controller shows `answer(offset of 1 s ago)`.
template <class Answer>
Bench swinging(const Answer& answer) {
  Bench bench;
  bench.obeys = false;
  std::array<double, 10> late_um{};
  for (std::size_t i = 0; i < 1200; ++i) {
    bench.input.applied_um = answer(late_um[i % 10]);
    bench.step(1.9 * std::sin(0.0157 * static_cast<double>(i)));
    late_um[i % 10] = bench.axis().offset_um();
  }
  return bench;
}

}  // namespace

TEST_CASE("a controller that ignores offsets below the tolerance becomes a mismatch", "[axis]") {
  Bench bench = swinging([](double) { return 0.0; });
  REQUIRE(bench.axis().latched());
  CHECK(bench.axis().latched_mismatch().likely == MismatchCause::stands_still);
  bench.release();  // mended
  bench.obeys = true;
  bench.steps(100, -1.9);
  CHECK_FALSE(bench.axis().mismatch());
  CHECK(bench.axis().offset_um() == -1.9);
}

TEST_CASE("a read-back that is late and rounded follows", "[axis]") {
  for (const double step_um : {0.01, 1.0, 2.54}) {
    CAPTURE(step_um);
    const Bench bench =
        swinging([step_um](double um) { return step_um * std::round(um / step_um); });
    CHECK_FALSE(bench.axis().mismatch());
    CHECK_FALSE(bench.axis().latched());
  }
}

TEST_CASE("a first read-back beyond the bound is not driven until it is back", "[axis]") {
  Bench bench;
  bench.obeys = false;
  for (const double applied_um : {50.2, -400.0, 1e30}) {
    bench.input.applied_um = applied_um;
    bench.step(1.0);
    CHECK(bench.axis().out_of_bound());
    CHECK_FALSE(bench.axis().driven());
    CHECK(std::abs(bench.axis().offset_um()) <= 50.0);
  }
  bench.input.applied_um = 49.0;
  bench.step(49.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 49.0);
}

TEST_CASE("a read-back rounded just beyond the bound is the bound", "[axis]") {
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = 50.05;
  bench.step(50.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 50.0);
}

TEST_CASE("a read-back without a number pauses the axis once it lasts, until it is a number again",
          "[axis]") {
  CompensationConfig compensation;
  compensation.mismatch_after_s = 2.0;
  Bench bench(true, axis_of(), compensation);
  bench.steps(20, 10.0);
  REQUIRE(bench.axis().offset_um() == Approx(4.0));
  bench.obeys = false;
  bench.input.applied_um = not_a_number;
  bench.steps(10, 10.0);
  CHECK(bench.axis().driven());
  CHECK_FALSE(bench.axis().mismatch());
  bench.steps(30, 10.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().mismatch());
  CHECK_FALSE(bench.axis().latched());
  const double paused_um = bench.axis().offset_um();
  bench.steps(100, 10.0);
  CHECK(bench.axis().offset_um() == paused_um);
  bench.input.applied_um = paused_um;
  bench.obeys = true;
  bench.steps(30, 10.0);
  CHECK(bench.axis().driven());
  CHECK_FALSE(bench.axis().mismatch());
}

TEST_CASE("while the controller is offline the offset continues without comparison", "[axis]") {
  Bench bench;
  bench.steps(10, 0.0);
  bench.obeys = false;
  bench.input.online = false;
  bench.input.applied_um = 33.0;
  bench.steps(10, 1.0);
  CHECK(bench.axis().driven());
  CHECK_FALSE(bench.axis().mismatch());
  CHECK(bench.axis().offset_um() == 1.0);
}

TEST_CASE("hold_while_cutting keeps the offset while cutting", "[axis]") {
  Bench bench;
  bench.steps(10, 1.0);
  bench.input.may_change = false;
  bench.steps(50, 9.0);
  CHECK(bench.axis().offset_um() == 1.0);
  CHECK(bench.axis().target_um() == 9.0);
  bench.input.may_change = true;
  bench.step(9.0);
  CHECK(bench.axis().offset_um() == Approx(1.2));
}

TEST_CASE("a refused offset goes back to the one in effect, no further, if the target is there",
          "[axis]") {
  Bench bench(GENERATE(true, false));
  bench.steps(50, -8.2);
  bench.obeys = false;  // -8.2 is beyond the controller's own limit
  bench.input.applied_um = -8.0;
  bench.input.written = false;
  bench.steps(20, -16.0);
  CHECK(bench.axis().offset_um() == Approx(-8.2));
  bench.steps(20, -4.0);
  CHECK(bench.axis().offset_um() == Approx(-8.0));
  bench.input.written = bench.obeys = true;
  bench.steps(50, -4.0);
  CHECK(bench.axis().offset_um() == Approx(-4.0));
}
