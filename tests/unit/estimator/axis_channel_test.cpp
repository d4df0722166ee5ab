#include "estimator/axes/axis_channel.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

AxisConfig axis_of(double offset_um_max = 50, double rate_um_per_s_max = 2) {
  return {"z", "z_um", 1.0, {offset_um_max, rate_um_per_s_max}};
}

/// An axis and the controller it talks to, stepped every 0.1 s.
struct Bench {
  explicit Bench(bool reads_back = true, const AxisConfig& axis = axis_of(),
                 const CompensationConfig& compensation = {})
      : channel(axis, compensation, reads_back) {
    input.dt_s = 0.1;
    input.link_epoch = 1;
    input.online = true;
    input.applied_um = 0.0;
  }
  /// The controller applies what it was sent in the step before.
  void step(double target_um) {
    if (obeys && channel.driven()) input.applied_um = channel.offset_um();
    input.now += 100ms;
    input.taken_at = input.now;
    input.target_um = target_um;
    channel.step(input);
  }
  void steps(int count, double target_um) {
    for (int i = 0; i < count; ++i) step(target_um);
  }
  AxisInput input;
  AxisChannel channel;
  bool obeys{true};
};

}  // namespace

TEST_CASE("an axis is not driven before the controller has told what it applies", "[axis]") {
  Bench bench;
  bench.obeys = false;
  bench.input.online = false;
  bench.steps(5, 30.0);
  CHECK_FALSE(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 0.0);
  bench.input.online = true;
  bench.input.applied_um = not_a_number;
  bench.steps(5, 30.0);
  CHECK_FALSE(bench.channel.synced());
  bench.input.applied_um = 12.0;
  bench.step(30.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(12.2));  // from what is applied, at the rate
}

TEST_CASE("an axis of a link that was never connected is not driven", "[axis]") {
  for (const bool reads_back : {true, false}) {
    Bench bench(reads_back);
    bench.input.link_epoch = 0;
    bench.steps(5, 30.0);
    CHECK_FALSE(bench.channel.driven());
    CHECK(bench.channel.offset_um() == 0.0);
  }
}

TEST_CASE("a controller that does not read back is driven from what was sent last", "[axis]") {
  Bench bench(false);
  bench.channel.restore(8.0);
  bench.input.applied_um = not_a_number;
  bench.step(8.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 8.0);
  CHECK(std::isnan(bench.channel.applied_um()));
  bench.input.link_epoch = 2;
  bench.steps(3, 8.0);
  CHECK(bench.channel.offset_um() == 8.0);
}

TEST_CASE("a new link starts from the read-back, not from what was sent", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  REQUIRE(bench.channel.offset_um() == 10.0);
  bench.input.online = false;
  bench.input.link_epoch = 2;
  bench.step(10.0);
  CHECK_FALSE(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);
  bench.obeys = false;
  bench.input.online = true;
  bench.input.applied_um = 3.0;
  bench.step(10.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(3.2));
  CHECK_FALSE(bench.channel.mismatch());
}

TEST_CASE("a restored offset that is out of date gives way to the read-back", "[axis]") {
  Bench bench;
  bench.channel.restore(40.0);
  bench.input.applied_um = -5.0;
  bench.obeys = false;
  bench.step(40.0);
  CHECK(bench.channel.offset_um() == Approx(-4.8));
}

TEST_CASE("a restored offset that no configuration allows is not taken", "[axis]") {
  for (const double offset_um : {501.0, -1e9, not_a_number}) {
    Bench bench(false);
    bench.channel.restore(offset_um);
    CHECK(bench.channel.offset_um() == 0.0);
  }
}

TEST_CASE("two unexplained read-backs end the driving until an operator releases it", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  CHECK_FALSE(bench.channel.mismatch());
  bench.obeys = false;
  bench.input.applied_um = 0.0;  // re-homed, and the link has not noticed
  bench.step(10.0);
  CHECK(bench.channel.mismatch());
  CHECK_FALSE(bench.channel.driven());
  CHECK_FALSE(bench.channel.latched());
  bench.step(10.0);
  CHECK(bench.channel.latched());
  CHECK(bench.channel.latched_mismatch().sent_um == 10.0);
  CHECK(bench.channel.latched_mismatch().read_um == 0.0);
  bench.steps(600, 10.0);
  CHECK_FALSE(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);  // a read-back is evidence, not a command
  bench.channel.release();
  bench.step(10.0);
  CHECK_FALSE(bench.channel.driven());  // one read-back may be from before
  bench.step(10.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(0.2));
  bench.obeys = true;
  bench.steps(80, 10.0);
  CHECK(bench.channel.offset_um() == 10.0);
  CHECK_FALSE(bench.channel.mismatch());
}

TEST_CASE("a released axis starts elsewhere only when its slew rate could have gone there",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.steps(3, 10.0);
  REQUIRE(bench.channel.latched());
  bench.channel.release();
  int steps = 0;
  while (!bench.channel.driven() && steps < 1000) {
    bench.step(10.0);
    ++steps;
  }
  CHECK(steps >= 45);  // 10 um at 2 um/s, less what had passed
  CHECK(steps <= 50);
  CHECK(bench.channel.offset_um() == Approx(0.2));
}

TEST_CASE("a read-back that is old when the link is new does not take the offset back", "[axis]") {
  Bench bench;
  bench.steps(50, 30.0);
  const double sent_um = bench.channel.offset_um();
  bench.obeys = false;
  bench.input.link_epoch = 2;
  bench.input.applied_um = sent_um - 1.0;  // half a second ago
  bench.step(30.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == sent_um);
  bench.obeys = true;
  bench.steps(4, 30.0);
  CHECK(bench.channel.offset_um() > sent_um);
  bench.obeys = false;
  bench.input.link_epoch = 3;
  bench.input.applied_um = 0.0;  // restarted
  bench.step(30.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(0.2));
}

TEST_CASE("an axis that a new link finds on its way back starts from there", "[axis]") {
  Bench bench;
  bench.steps(145, 30.0);  // the values on the way are of the last moments
  const double sent_um = bench.channel.offset_um();
  bench.obeys = false;
  bench.input.link_epoch = 2;
  bench.input.applied_um = not_a_number;
  for (int i = 0; i < 16; ++i) bench.step(30.0);
  bench.input.link_epoch = 3;
  bench.input.applied_um = 0.9 * sent_um;
  bench.step(30.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(0.9 * sent_um + 0.2));
}

TEST_CASE("a release that is said again does not wait anew for the read-backs of a slow link",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.steps(3, 10.0);
  REQUIRE(bench.channel.latched());
  int steps = 0;
  for (; !bench.channel.driven() && steps < 1000; ++steps) {
    bench.channel.release();
    bench.input.now += 100ms;
    if (steps % 10 == 0) bench.input.taken_at = bench.input.now;  // a read-back each second
    bench.channel.step(bench.input);
  }
  CHECK(steps <= 61);
}

TEST_CASE("what was read before the first write is nobody's answer to it", "[axis]") {
  // It is 3 um beside from the first contact on: not another writer.
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = 3.0;
  for (int i = 0; i < 100 && !bench.channel.latched(); ++i) {
    bench.step(-20.0);
    if (i >= 2 && bench.channel.driven()) bench.input.applied_um = bench.channel.offset_um() + 3.0;
  }
  REQUIRE(bench.channel.latched());
  const std::string told = likely_text(bench.channel.latched_mismatch());
  CHECK(told.find("constant +3.0 um") != std::string::npos);
  CHECK(told.find("another writer") == std::string::npos);
}

TEST_CASE("a factor that explains the older read-backs badly is not sure, and can be released",
          "[axis]") {
  SentAndRead pairs;
  for (const double um : {-1.0, -2.0, -2.7}) pairs.note(um, um);
  const Mismatch found = pairs.judge(-6.72, -2.72);
  CHECK_FALSE(found.sure);
  CHECK_FALSE(found.explains(-6.72, -2.72));
}

TEST_CASE("one unexplained read-back pauses the axis, which goes on from its own offset",
          "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = -40.0;
  bench.step(12.0);
  CHECK_FALSE(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);
  bench.input.applied_um = 10.0;
  bench.step(12.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(10.2));
  bench.input.applied_um = -40.0;  // once more, soon after: no accident
  bench.step(12.0);
  CHECK(bench.channel.latched());
}

TEST_CASE("a pause of the same link changes nothing that is sent", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.input.link_epoch += epochs_of_a_link;
  bench.obeys = false;
  bench.input.applied_um = 9.1;  // within what counts as agreement
  bench.steps(2, 12.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);  // until a command of the new epoch has been written
  bench.step(12.0);
  CHECK(bench.channel.offset_um() == Approx(10.2));
}

TEST_CASE("a controller that refuses what it is sent finds no pent-up offset later", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  for (int i = 0; i < 100; ++i) {
    bench.input.link_epoch += epochs_of_a_link;
    bench.steps(2, 40.0);
  }
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);
}

TEST_CASE("a new link that shows neither what was sent nor less of it is not believed", "[axis]") {
  for (const double applied_um : {20.0, -10.0, 13.0}) {
    Bench bench;
    bench.steps(100, 10.0);
    bench.obeys = false;
    bench.input.link_epoch = 2;
    bench.input.applied_um = applied_um;
    bench.step(10.0);
    CHECK_FALSE(bench.channel.driven());
    bench.step(10.0);
    CHECK(bench.channel.latched());
    CHECK(bench.channel.offset_um() == 10.0);
  }
}

namespace {

/// A controller that applies (and shows) what `answer` makes of an offset.
template <class Answer>
Bench lied_to(double target_um, const Answer& answer) {
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = answer(0.0);
  double before_um = bench.input.applied_um;
  for (int i = 0; i < 400; ++i) {
    bench.step(target_um);
    // From the first contact on the offset keeps its slew, whatever is read back.
    CHECK(std::abs(bench.channel.offset_um() - before_um) <= 0.2 + 1e-9);
    before_um = bench.channel.offset_um();
    if (bench.channel.driven()) bench.input.applied_um = answer(bench.channel.offset_um());
  }
  CHECK(bench.channel.latched());
  return bench;
}

std::string said(const Bench& bench) {
  return likely_text(bench.channel.latched_mismatch());
}

}  // namespace

TEST_CASE("the usual mistakes of commissioning are told by their names", "[axis]") {
  CHECK(said(lied_to(-30.0, [](double um) { return 2.0 * um; })) ==
        "reads back twice what is sent: check scale");
  CHECK(said(lied_to(30.0, [](double um) { return 0.5 * um; })) ==
        "reads back half of what is sent: check scale");
  CHECK(said(lied_to(30.0, [](double um) { return 10.0 * um; })) ==
        "reads back 10 times what is sent: check scale");
  CHECK(said(lied_to(-30.0, [](double um) { return -um; })) == "opposite sign: check sign");
  CHECK(said(lied_to(30.0, [](double um) { return -2.0 * um; })) ==
        "reads back -2 times what is sent: check scale and sign");
  CHECK(said(lied_to(-30.0, [](double um) { return um + 3.0; })) ==
        "constant +3.0 um: check the offset's zero");
  CHECK(said(lied_to(30.0, [](double) { return 1.0; })) ==
        "does not take what is sent (rejects it or stands still)");
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 31.0;
  bench.steps(3, 10.0);
  CHECK(said(bench) == "changes without us: another writer?");
}

TEST_CASE("a release does not believe what is still as wrong as it was", "[axis]") {
  Bench bench = lied_to(-30.0, [](double um) { return 2.0 * um; });
  const double sent_um = bench.channel.offset_um();
  bench.channel.release();
  bench.steps(50, -30.0);
  CHECK(bench.channel.latched());
  CHECK_FALSE(bench.channel.releasing());
  CHECK(bench.channel.offset_um() == sent_um);
  bench.input.applied_um = sent_um;  // the scale is mended
  bench.channel.release();
  bench.steps(2, -30.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == Approx(sent_um - 0.2));
}

TEST_CASE("a latched mismatch outlives a new link and a reload", "[axis]") {
  Bench bench = lied_to(-30.0, [](double um) { return -um; });
  bench.input.link_epoch = 2;
  bench.input.applied_um = 0.0;
  bench.steps(10, -30.0);
  CHECK(bench.channel.latched());
  Bench after;
  after.channel.adopt(bench.channel);
  after.input = bench.input;
  after.steps(10, -30.0);
  CHECK(after.channel.latched());
  CHECK_FALSE(after.channel.driven());
  CHECK(said(after) == "opposite sign: check sign");
}

TEST_CASE("after a disagreement an old read-back does not start an axis", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  bench.step(10.0);
  const nanoseconds taken_at = bench.input.taken_at;
  for (int i = 0; i < 20; ++i) {  // the very same read-back again and again
    bench.input.now += 100ms;
    bench.input.taken_at = taken_at;
    bench.channel.step(bench.input);
    CHECK_FALSE(bench.channel.driven());
  }
}

TEST_CASE("an axis that was overridden stands where it is", "[axis]") {
  // A link slower than the cycle: what is read back is what was sent two steps before.
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = 0.0;
  for (int i = 0; i < 200; ++i) bench.step(10.0);
  CHECK_FALSE(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 10.0);
}

TEST_CASE("a read-back that is late, but of what was sent, is no mismatch", "[axis]") {
  Bench bench;
  bench.steps(50, 5.0);
  bench.obeys = false;  // the read-back stands still while the offset goes on
  const double before_um = bench.channel.offset_um();
  for (int i = 0; i < 20; ++i) bench.step(20.0);
  CHECK_FALSE(bench.channel.mismatch());
  CHECK(bench.channel.offset_um() > before_um + 3.9);
}

TEST_CASE("a controller that ignores what it is sent becomes a mismatch", "[axis]") {
  Bench bench;
  bench.steps(10, 0.0);
  bench.obeys = false;
  bench.steps(60, 50.0);
  CHECK(bench.channel.latched());
  CHECK(bench.channel.offset_um() < 50.0);
}

TEST_CASE("a first read-back beyond the bound is not driven until it is back", "[axis]") {
  Bench bench;
  bench.obeys = false;
  for (const double applied_um : {50.2, -400.0, 1e30}) {
    bench.input.applied_um = applied_um;
    bench.step(1.0);
    CHECK(bench.channel.out_of_bound());
    CHECK_FALSE(bench.channel.driven());
    CHECK(std::abs(bench.channel.offset_um()) <= 50.0);
  }
  bench.input.applied_um = 49.0;
  bench.step(49.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 49.0);
}

TEST_CASE("a read-back rounded just beyond the bound is the bound", "[axis]") {
  Bench bench;
  bench.obeys = false;
  bench.input.applied_um = 50.05;
  bench.step(50.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 50.0);
}

TEST_CASE("a read-back that is no number changes nothing once in agreement", "[axis]") {
  Bench bench;
  bench.steps(100, 10.0);
  bench.obeys = false;
  bench.input.applied_um = not_a_number;
  bench.steps(50, 12.0);
  CHECK(bench.channel.driven());
  CHECK(bench.channel.offset_um() == 12.0);
}

TEST_CASE("while the controller is silent the offset goes on without comparison", "[axis]") {
  Bench bench;
  bench.steps(10, 0.0);
  bench.obeys = false;
  bench.input.online = false;
  bench.input.applied_um = 33.0;
  bench.steps(10, 1.0);
  CHECK(bench.channel.driven());
  CHECK_FALSE(bench.channel.mismatch());
  CHECK(bench.channel.offset_um() == 1.0);
}

TEST_CASE("the surface-aware hold keeps the offset while cutting", "[axis]") {
  Bench bench;
  bench.steps(10, 1.0);
  bench.input.may_change = false;
  bench.steps(50, 9.0);
  CHECK(bench.channel.offset_um() == 1.0);
  CHECK(bench.channel.target_um() == 9.0);
  bench.input.may_change = true;
  bench.step(9.0);
  CHECK(bench.channel.offset_um() == Approx(1.2));
}

TEST_CASE("a proving move goes out and back and ends where it began", "[axis]") {
  Bench bench;
  bench.steps(50, 4.0);
  bench.channel.prove(6.0);
  CHECK(bench.channel.proving());
  double largest_um = 0.0;
  int steps = 0;
  double before_um = bench.channel.offset_um();
  while (bench.channel.proving() && steps < 1000) {
    bench.step(-30.0);  // the compensation waits
    if (bench.channel.proving()) CHECK(bench.channel.offset_um() >= 4.0);
    CHECK(std::abs(bench.channel.offset_um() - before_um) <= 0.2 + 1e-12);
    before_um = bench.channel.offset_um();
    largest_um = std::max(largest_um, before_um);
    ++steps;
  }
  CHECK(largest_um == 10.0);
  CHECK(bench.channel.offset_um() == 4.0);
  CHECK(steps >= 30 + 30 + 30);  // 3 s out, 3 s there, 3 s back
  bench.step(-30.0);
  CHECK(bench.channel.offset_um() == Approx(3.8));
}

TEST_CASE("a proving move stays within the bound", "[axis]") {
  Bench bench(true, axis_of(5, 10));
  bench.steps(20, 4.0);
  bench.channel.prove(9.0);
  double largest_um = 0.0;
  for (int i = 0; i < 200; ++i) {
    bench.step(not_a_number);
    largest_um = std::max(largest_um, bench.channel.offset_um());
  }
  CHECK(largest_um == 5.0);
  CHECK(bench.channel.offset_um() == 4.0);
  CHECK_FALSE(bench.channel.proving());
}

TEST_CASE("a proving move that is too long, no number or of an axis not driven is ignored",
          "[axis]") {
  Bench bench;
  bench.channel.prove(5.0);
  CHECK_FALSE(bench.channel.proving());
  bench.step(0.0);
  for (const double move_um : {10.1, -10.1, not_a_number}) {
    bench.channel.prove(move_um);
    CHECK_FALSE(bench.channel.proving());
  }
  bench.channel.prove(-10.0);
  CHECK(bench.channel.proving());
}

TEST_CASE("losing the link ends a proving move", "[axis]") {
  Bench bench;
  bench.steps(5, 0.0);
  bench.channel.prove(5.0);
  bench.steps(5, 0.0);
  bench.input.link_epoch = 2;
  bench.input.online = false;
  bench.step(0.0);
  CHECK_FALSE(bench.channel.proving());
}

TEST_CASE("after a reload the axis goes on from where it is", "[axis]") {
  Bench before;
  before.steps(300, 40.0);
  Bench after(true, axis_of(10, 2));
  after.channel.adopt(before.channel);
  after.input = before.input;
  CHECK(after.channel.driven());
  double last_um = 40.0;
  for (int i = 0; i < 150; ++i) {
    after.step(40.0);
    CHECK(after.channel.offset_um() == Approx(std::max(10.0, last_um - 0.2)));
    last_um = after.channel.offset_um();
  }
  CHECK(last_um == 10.0);
  CHECK(after.channel.driven());
  CHECK_FALSE(after.channel.mismatch());
}
