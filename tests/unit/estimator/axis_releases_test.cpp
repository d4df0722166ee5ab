// Latched mismatch of an axis: its report and its release.
#include <cmath>
#include <string>

#include <catch2/catch.hpp>

#include "axis_bench.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace std::chrono_literals;

namespace {

/// A controller that applies (and shows) `answer(offset)`.
template <class Answer>
Bench wrong_read_back(double target_um, const Answer& answer) {
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = answer(0.0);
  double before_um = bench.input.applied_um;
  for (int i = 0; i < 400; ++i) {
    bench.step(target_um);
    // From the first contact on, the offset keeps its slew limit for any read-back.
    CHECK(std::abs(bench.axis().offset_um() - before_um) <= 0.2 + 1e-9);
    before_um = bench.axis().offset_um();
    if (bench.axis().driven()) bench.input.applied_um = answer(bench.axis().offset_um());
  }
  CHECK(bench.axis().latched());
  return bench;
}

std::string cause_text(const Bench& bench) {
  return likely_text(bench.axis().latched_mismatch());
}

}  // namespace

TEST_CASE("two unexplained read-backs stop the axis until an operator releases it", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  CHECK_FALSE(bench.axis().mismatch());
  bench.obeys = false;
  bench.input.applied_um = 0.0;  // re-homed, not noticed by the link
  bench.step(10.0);
  CHECK(bench.axis().mismatch());
  CHECK_FALSE(bench.axis().driven());
  CHECK_FALSE(bench.axis().latched());
  bench.step(10.0);
  CHECK(bench.axis().latched());
  CHECK(bench.axis().latched_mismatch().sent_um == 10.0);
  CHECK(bench.axis().latched_mismatch().read_um == 0.0);
  bench.steps(600, 10.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);  // a read-back is evidence, not a command
  bench.release();
  bench.step(10.0);
  CHECK_FALSE(bench.axis().driven());  // one read-back may be from before
  bench.step(10.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(0.2));
  bench.obeys = true;
  bench.steps(80, 10.0);
  CHECK(bench.axis().offset_um() == 10.0);
  CHECK_FALSE(bench.axis().mismatch());
}

TEST_CASE("a released axis starts elsewhere only within reach of its slew rate", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.steps(3, 10.0);
  REQUIRE(bench.axis().latched());
  bench.release();
  int steps = 0;
  while (!bench.axis().driven() && steps < 1000) {
    bench.step(10.0);
    ++steps;
  }
  CHECK(steps >= 45);  // 10 um at 2 um/s, less the time passed
  CHECK(steps <= 50);
  CHECK(bench.axis().offset_um() == Approx(0.2));
}

TEST_CASE("a constant that appears while running is accepted by one release and no other",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);  // correct for some time, at rest
  bench.obeys = false;
  double added_um = 12.0;
  double applied_um = 10.0 + added_um;
  const auto steps = [&](int count) {
    for (int i = 0; i < count; ++i) {
      if (bench.axis().driven()) applied_um = bench.axis().offset_um() + added_um;
      bench.input.applied_um = applied_um;
      bench.step(10.0);
    }
  };
  steps(100);
  REQUIRE(bench.axis().latched());
  CHECK(bench.axis().latched_mismatch().likely == MismatchCause::changes_alone);
  bench.release();  // another writer could have left it there
  steps(100);
  REQUIRE(bench.axis().latched());
  CHECK(bench.axis().latched_mismatch().likely == MismatchCause::constant);
  CHECK(bench.axis().latched_mismatch().size == Approx(12.0).margin(0.5));
  const double sent_um = bench.axis().offset_um();
  CHECK(std::abs(sent_um - 22.0) < 1.0);
  for (int i = 0; i < 5; ++i) {
    bench.release();
    steps(100);
    CHECK(bench.axis().latched());
    CHECK(bench.axis().offset_um() == sent_um);
  }
  added_um = 0.0;  // repaired
  applied_um = sent_um;
  bench.release();
  steps(200);
  CHECK_FALSE(bench.axis().latched());
  CHECK(bench.axis().offset_um() == Approx(10.0));
}

TEST_CASE("a repeated release does not restart the wait for the read-backs of a slow link",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.steps(3, 10.0);
  REQUIRE(bench.axis().latched());
  int steps = 0;
  for (; !bench.axis().driven() && steps < 1000; ++steps) {
    bench.release();
    bench.input.now += 100ms;
    if (steps % 10 == 0) bench.input.taken_at = bench.input.now;  // one read-back per second
    bench.read_back();
  }
  CHECK(steps <= 61);
}

TEST_CASE("a read-back from before the first write is not an answer to it", "[axis]") {
  // It is 3 um off from the first contact on: not another writer.
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = 3.0;
  for (int i = 0; i < 100 && !bench.axis().latched(); ++i) {
    bench.step(-20.0);
    if (i >= 2 && bench.axis().driven()) bench.input.applied_um = bench.axis().offset_um() + 3.0;
  }
  REQUIRE(bench.axis().latched());
  const std::string message = likely_text(bench.axis().latched_mismatch());
  CHECK(message.find("constant +3.0 um") != std::string::npos);
  CHECK(message.find("another writer") == std::string::npos);
}

TEST_CASE("a factor that explains the older read-backs badly is not sure and can be released",
          "[axis]") {
  SentAndRead pairs;
  for (const double um : {-1.0, -2.0, -2.7}) pairs.note(um, um);
  const Mismatch found = pairs.judge(-6.72, -2.72);
  CHECK_FALSE(found.sure);
  CHECK_FALSE(found.explains(-6.72, -2.72));
}

TEST_CASE("the usual mistakes of commissioning are reported by name", "[axis]") {
  CHECK(cause_text(wrong_read_back(-30.0, [](double um) { return 2.0 * um; })) ==
        "reads back twice what is sent: check scale");
  CHECK(cause_text(wrong_read_back(30.0, [](double um) { return 0.5 * um; })) ==
        "reads back half of what is sent: check scale");
  CHECK(cause_text(wrong_read_back(30.0, [](double um) { return 10.0 * um; })) ==
        "reads back 10 times what is sent: check scale");
  CHECK(cause_text(wrong_read_back(-30.0, [](double um) { return -um; })) ==
        "opposite sign: check sign");
  CHECK(cause_text(wrong_read_back(30.0, [](double um) { return -2.0 * um; })) ==
        "reads back -2 times what is sent: check scale and sign");
  CHECK(cause_text(wrong_read_back(-30.0, [](double um) { return um + 3.0; })) ==
        "constant +3.0 um: check the offset's zero");
  CHECK(cause_text(wrong_read_back(30.0, [](double) { return 1.0; })) ==
        "does not follow the offset sent: not taken (rejected, or stopped)");
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 31.0;
  bench.steps(3, 10.0);
  CHECK(cause_text(bench) == "changes by itself: another writer, a restart or a limit?");
}

TEST_CASE("a controller that stops taking offsets is no other writer", "[axis]") {
  Bench bench(true, axis_of(50, 0.2));
  bench.steps(270, -30.0);
  bench.obeys = false;
  bench.steps(200, -30.0);
  REQUIRE(bench.axis().latched());
  CHECK(cause_text(bench) == "does not follow the offset sent: not taken (rejected, or stopped)");
}

TEST_CASE("an offset that a pausing link did not write is not judged", "[axis]") {
  Bench bench;
  bench.obeys = false;
  bench.steps(5, 0.0);
  bench.step(-0.4);
  bench.input.applied_um = 10 * bench.axis().offset_um();  // within the tolerance of the link
  bench.input.now += 10ms;  // the offset moves on, and the command is written
  bench.input.taken_at = bench.input.now;
  bench.read_back();
  const double written_um = bench.axis().offset_um();
  bench.step(-3.0);
  bench.input.applied_um = 10 * written_um;
  bench.input.link_epoch += epochs_of_a_link;
  bench.steps(2, -3.0);
  REQUIRE(bench.axis().latched());
  CHECK(bench.axis().latched_mismatch().sent_um == Approx(written_um));
  CHECK(cause_text(bench) == "reads back 10 times what is sent: check scale");
}

TEST_CASE("a sign that flips while running is reported by name", "[axis]") {
  for (const bool moves : {false, true}) {
    Bench bench;
    bench.steps(100, 10.0);
    bench.obeys = false;
    for (int i = 0; i < 5; ++i) {
      bench.input.applied_um = -bench.axis().offset_um();
      bench.step(moves ? 30.0 : 10.0);
    }
    REQUIRE(bench.axis().latched());
    CHECK(cause_text(bench) == "opposite sign: check sign");
    bench.release();
    bench.steps(50, 10.0);
    CHECK(bench.axis().latched());  // still opposite
  }
}

TEST_CASE("a release is refused while the same cause persists", "[axis]") {
  Bench bench = wrong_read_back(-30.0, [](double um) { return 2.0 * um; });
  const double sent_um = bench.axis().offset_um();
  bench.release();
  bench.steps(50, -30.0);
  CHECK(bench.axis().latched());
  CHECK_FALSE(bench.axis().releasing());
  CHECK(bench.axis().offset_um() == sent_um);
  bench.input.applied_um = sent_um;  // the scale is corrected
  bench.release();
  bench.steps(2, -30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(sent_um - 0.2));
}

TEST_CASE("a latched mismatch survives a new link and a reload", "[axis]") {
  Bench bench = wrong_read_back(-30.0, [](double um) { return -um; });
  bench.input.link_epoch = 2;
  bench.input.applied_um = 0.0;
  bench.steps(10, -30.0);
  CHECK(bench.axis().latched());
  Bench after;
  after.bank.adopt(bench.bank, {0});
  after.input = bench.input;
  after.steps(10, -30.0);
  CHECK(after.axis().latched());
  CHECK_FALSE(after.axis().driven());
  CHECK(cause_text(after) == "opposite sign: check sign");
}
