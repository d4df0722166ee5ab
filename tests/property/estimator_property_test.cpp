#include <algorithm>

#include <catch2/catch.hpp>

#include "estimator_world.hpp"

using namespace thermocomp::property;

namespace {

constexpr std::uint64_t seeds = 400;

std::string text_of(const Outcome& outcome) {
  if (!outcome.violation) return "nothing";
  const Violation& violation = *outcome.violation;
  return std::string(violation.rule).append(": ").append(violation.what) + ", step " +
         std::to_string(violation.step) + ": " + std::to_string(violation.value) + " beside " +
         std::to_string(violation.allowed);
}

/// Number of seeds in which an invariant detects the planted bug.
std::size_t noticed(Planted planted, bool travel = false) {
  std::size_t count = 0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    WorldOptions options;
    options.planted = planted;
    options.travel = travel;
    if (live(seed, options).violation) ++count;
  }
  return count;
}

/// True if useless readings have another effect than missing readings.
bool useless_readings_matter(std::uint64_t seed, Planted planted) {
  WorldOptions useless;
  useless.planted = planted;
  useless.lost_from = 200;
  WorldOptions withheld = useless;
  withheld.lost_are_withheld = true;
  return live(seed, useless).trace != live(seed, withheld).trace;
}

bool loaded_state_matters(std::uint64_t seed, Planted planted) {
  WorldOptions through;
  WorldOptions interrupted;
  interrupted.planted = planted;
  interrupted.reload_state_at = 250;
  return live(seed, through).trace != live(seed, interrupted).trace;
}

}  // namespace

TEST_CASE("a promotion that adopts nothing is noticed", "[property][estimator]") {
  WorldOptions options;
  options.planted = Planted::reload_from_nothing;
  options.promotion_every = 40;
  std::size_t count = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed)
    if (live(seed, options).violation) ++count;
  CHECK(count > 50);
}

TEST_CASE("a promoted model and the way back keep the offsets' bound and slew",
          "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, 100));
  CAPTURE(seed);
  WorldOptions options;
  options.promotion_every = 40;
  const Outcome outcome = live(seed, options);
  INFO(text_of(outcome));
  CHECK_FALSE(outcome.violation.has_value());
}

TEST_CASE("whatever happens, offsets keep their bound and slew and are sent only where known",
          "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, seeds));
  CAPTURE(seed);
  const Outcome outcome = live(seed, {});
  INFO(text_of(outcome));
  CHECK_FALSE(outcome.violation.has_value());
}

TEST_CASE("so do the nodes of a travel, each by itself and all together", "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, seeds));
  CAPTURE(seed);
  WorldOptions options;
  options.travel = true;
  const Outcome outcome = live(seed, options);
  INFO(text_of(outcome));
  CHECK_FALSE(outcome.violation.has_value());
}

TEST_CASE("a state saved and loaded in the middle of a life with a travel changes no bit",
          "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, seeds));
  CAPTURE(seed);
  WorldOptions through;
  through.travel = true;
  WorldOptions interrupted = through;
  interrupted.reload_state_at = 250;
  CHECK(live(seed, through).trace == live(seed, interrupted).trace);
}

TEST_CASE("the random lives reach what they are meant to test", "[property][estimator]") {
  Outcome all;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    const Outcome outcome = live(seed, {});
    all.steps_compensating += outcome.steps_compensating;
    all.steps_estimating += outcome.steps_estimating;
    all.steps_outside += outcome.steps_outside;
    all.returns += outcome.returns;
    all.resyncs += outcome.resyncs;
    all.reloads += outcome.reloads;
    all.restarts += outcome.restarts;
    all.largest_offset_um = std::max(all.largest_offset_um, outcome.largest_offset_um);
  }
  CHECK(all.steps_compensating > seeds * 60);
  CHECK(all.steps_estimating > seeds * 10);
  CHECK(all.steps_outside > seeds * 30);
  CHECK(all.returns > seeds);
  CHECK(all.resyncs > seeds);
  CHECK(all.reloads > seeds);
  CHECK(all.restarts > seeds);
  CHECK(all.largest_offset_um > 80.0);
}

TEST_CASE("a stale or impossible reading never moves the axis", "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, seeds));
  CAPTURE(seed);
  CHECK_FALSE(useless_readings_matter(seed, Planted::nothing));
}

TEST_CASE("a state saved and loaded in the middle of a life changes no bit",
          "[property][estimator]") {
  const auto seed = GENERATE(range<std::uint64_t>(0, seeds));
  CAPTURE(seed);
  CHECK_FALSE(loaded_state_matters(seed, Planted::nothing));
}

TEST_CASE("planted bugs break the rules", "[property][estimator]") {
  CHECK(noticed(Planted::double_rate) > seeds / 2);
  CHECK(noticed(Planted::larger_bound) > seeds / 20);
  CHECK(noticed(Planted::domain_ignored) > seeds / 20);
  CHECK(noticed(Planted::always_valid) > seeds / 2);
  CHECK(noticed(Planted::epoch_ignored) > seeds / 20);
  CHECK(noticed(Planted::read_back_hidden) > seeds / 2);
  CHECK(noticed(Planted::reload_from_nothing) > seeds / 20);
}

TEST_CASE("planted bugs break the rules along a travel too", "[property][estimator]") {
  CHECK(noticed(Planted::double_rate, true) > seeds / 2);
  CHECK(noticed(Planted::larger_bound, true) > seeds / 20);
  CHECK(noticed(Planted::always_valid, true) > seeds / 2);
  CHECK(noticed(Planted::read_back_hidden, true) > seeds / 2);
}

TEST_CASE("hidden faults and a forgotten state are noticed", "[property][estimator]") {
  std::size_t faults = 0;
  std::size_t states = 0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    if (useless_readings_matter(seed, Planted::faults_hidden)) ++faults;
    if (loaded_state_matters(seed, Planted::forgotten_state)) ++states;
  }
  CHECK(faults > seeds / 2);
  CHECK(states > seeds / 2);
}
