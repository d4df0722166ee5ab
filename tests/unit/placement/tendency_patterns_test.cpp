// Tests of patterns of the structure file: their blocks, r, and its reduction.
#include "machines.hpp"
#include "modelling/placement/tendency_method.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace thermocomp::placement;

namespace {

const std::string lower_half = R"([[placement.pattern]]
name = "lower half"
blocks = ["left_low_degC", "right_low_degC"]
percents = [20, -7.5]
)";
const std::string upper_left = R"([[placement.pattern]]
name = "upper left"
blocks = ["left_high_degC"]
)";

Pattern pattern(std::vector<bool> blocks, bool shrinks_as_one) {
  return {"some", std::move(blocks), {10.0}, shrinks_as_one};
}

}  // namespace

TEST_CASE("patterns of the file replace the derived ones", "[placement][tendency]") {
  const std::string text = column + cooled + heater + cases;
  const PlacementProblem derived = problem_of(machine_of(text));
  CHECK(derived.patterns.empty());
  CHECK(patterns_of(derived, derived.used.front()).size() == 9);  // all, four halves, four blocks
  const PlacementProblem own = problem_of(machine_of(text + lower_half + upper_left));
  const std::vector<Pattern> patterns = patterns_of(own, own.used.front());
  REQUIRE(patterns.size() == 2);
  CHECK(patterns[0].blocks == std::vector<bool>{true, true, false, false});
  CHECK(patterns[0].percents == Numbers{20.0, -7.5});
  CHECK(patterns[1].blocks == std::vector<bool>{false, false, true, false});
  CHECK(patterns[1].percents == Numbers{10.0, -10.0, 5.0, -5.0});
  for (const Field& field : own.used) {
    for (const TendencyRound& round : run_tendencies(own, field, Way::difference, {}).rounds) {
      CAPTURE(round.pattern);
      const bool known =
          round.pattern.starts_with("lower half ") || round.pattern.starts_with("upper left ");
      CHECK(known);
    }
  }
}

TEST_CASE("a pattern inside the bounds changes its blocks by r and no others",
          "[placement][tendency]") {
  const BlockBounds wide{{0, 0, -9}, {9, 9, 0}};
  const auto changed = change_blocks(pattern({true, false, true}, true), 10, wide, {4, 5, -2});
  CHECK(changed.name == "some +10 %");
  CHECK(changed.blocks_K[0] == Approx(4.4));
  CHECK(changed.blocks_K[1] == 5.0);
  CHECK(changed.blocks_K[2] == Approx(-2.2));
}

TEST_CASE("a block at its bound reduces r for the whole pattern", "[placement][tendency]") {
  const Numbers blocks_K{4, 5, -2};
  const BlockBounds narrow{{0, 0, -2.05}, {4.3, 9, 0}};  // 7.5 % of the first, 2.5 % of the last
  const auto changed = change_blocks(pattern({true, true, true}, true), 10, narrow, blocks_K);
  CHECK(changed.name == "some +2.5 % (of 10 %)");
  CHECK(changed.blocks_K[0] == Approx(4.1));
  CHECK(changed.blocks_K[1] == Approx(5.125));
  CHECK(changed.blocks_K[2] == Approx(-2.05));
  const auto without = change_blocks(pattern({true, true, false}, true), 10, narrow, blocks_K);
  CHECK(without.blocks_K[0] == Approx(4.3));
  CHECK(without.blocks_K[1] == Approx(5.375));
}

TEST_CASE("a negative r is limited by the lower bounds", "[placement][tendency]") {
  const BlockBounds narrow{{3.8, 0, -9}, {9, 9, -1.96}};
  const auto changed = change_blocks(pattern({true, false, true}, true), -10, narrow, {4, 5, -2});
  CHECK(changed.name == "some -2 % (of 10 %)");
  CHECK(changed.blocks_K[0] == Approx(3.92));
  CHECK(changed.blocks_K[2] == Approx(-1.96));
}

TEST_CASE("a block already at its bound cancels the pattern", "[placement][tendency]") {
  const BlockBounds at_bound{{0, 0}, {4, 9}};
  CHECK(change_blocks(pattern({true, true}, true), 10, at_bound, {4, 5}).blocks_K == Numbers{4, 5});
}

TEST_CASE("in a derived pattern each block stops at its own bound", "[placement][tendency]") {
  const BlockBounds narrow{{0, 0}, {4.1, 9}};
  const auto changed = change_blocks(pattern({true, true}, false), 10, narrow, {4, 5});
  CHECK(changed.name == "some +10 %");
  CHECK(changed.blocks_K[0] == Approx(4.1));
  CHECK(changed.blocks_K[1] == Approx(5.5));
}

TEST_CASE("problems of a pattern are named with line and value", "[placement][bad_input]") {
  struct Case {
    std::string text, reported;
  };
  const std::string head = "[[placement.pattern]]\nname = \"some\"\n";
  const std::vector<Case> listed{
      {head, "placement.pattern[some].blocks = (missing): must be given"},
      {"[[placement.pattern]]\nblocks = [\"left_low_degC\"]\n", "placement.pattern[1].name"},
      {head + "blocks = []\n", "must name at least one block"},
      {head + "blocks = [\"left_lo_degC\"]\n",
       "left_lo_degC: there is no block of this name; did you mean \"left_low_degC\"?"},
      {head + "blocks = [\"left_low_degC\", \"left_low_degC\"]\n", "left_low_degC: is named twice"},
      {head + "blocks = [\"left_low_degC\"]\npercents = []\n", "must have at least one number"},
      {head + "blocks = [\"left_low_degC\"]\npercents = [5, 0]\n", "must not have 0"},
      {head + "blocks = [\"left_low_degC\"]\npercents = [101]\n", "must be in [-100, 100]"},
      {head + "blocks = [\"left_low_degC\"]\npercent = [5]\n", "unknown key"},
      {upper_left + upper_left, "placement.pattern[upper left].name"},
  };
  for (const auto& [text, reported] : listed) {
    CAPTURE(reported);
    try {
      static_cast<void>(structure::parse_structure(column + text, "machine.toml"));
      FAIL("nothing was wrong");
    } catch (const std::exception& error) {
      CHECK_THAT(error.what(), Catch::Contains(reported) && Catch::StartsWith("machine.toml:"));
    }
  }
}
