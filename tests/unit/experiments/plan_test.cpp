#include <algorithm>
#include <random>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "modelling/experiments/test_plan.hpp"

namespace thermocomp::experiments {
namespace {

const std::string two_factors = R"(
[[factor]]
name = "spindle_rpm"
levels = [1000, 3000, 5000]
[[factor]]
name = "coolant"
levels = ["off", "on"]
)";

/// Independent of PairTable: uses the finished rows only.
std::size_t pairs_missing(const Design& design) {
  std::size_t missing = 0;
  for (std::size_t a = 0; a < design.level_counts.size(); ++a)
    for (std::size_t b = a + 1; b < design.level_counts.size(); ++b)
      for (int x = 0; x < design.level_counts[a]; ++x)
        for (int y = 0; y < design.level_counts[b]; ++y)
          if (std::none_of(design.rows.begin(), design.rows.end(),
                           [&](const auto& row) { return row[a] == x && row[b] == y; }))
            ++missing;
  return missing;
}

TEST_CASE("every listed array is balanced, of strength two, and as large as its name says",
          "[plan]") {
  for (const std::string& name : array_names()) {
    for (const Design& array : array_variants(name)) {
      CAPTURE(array.name);
      CHECK(array.rows.size() == std::stoul(name.substr(1)));
      CHECK(strength_of(array) >= 2);
      CHECK(pairs_missing(array) == 0);
      // Saturated: the columns use all degrees of freedom (except some of 2 x 3 in L18).
      int freedom = 0;
      for (const int levels : array.level_counts) freedom += levels - 1;
      const int left_over = static_cast<int>(array.rows.size()) - 1 - freedom;
      CHECK(left_over == (name == "L18" ? (array.level_counts[0] == 6 ? 0 : 2) : 0));
    }
  }
}

TEST_CASE("an array with one changed level is no longer reported as balanced", "[plan]") {
  Design array = array_variants("L9").front();
  REQUIRE(strength_of(array) == 2);
  array.rows[4][1] = (array.rows[4][1] + 1) % 3;
  CHECK(strength_of(array) == 0);
  Design swapped = array_variants("L9").front();
  std::swap(swapped.rows[0][1], swapped.rows[3][1]);  // levels stay balanced, pairs do not
  CHECK(strength_of(swapped) == 1);
}

TEST_CASE("a half fraction of four two-level factors has strength three", "[plan]") {
  const Design array = array_variants("L8").front();
  Design part{"", {2, 2, 2, 2}, {}};
  for (const auto& row : array.rows) part.rows.push_back({row[0], row[1], row[3], row[6]});
  CHECK(strength_of(part) == 3);
}

TEST_CASE("all pairs covers every pair of twenty random factor sets, also with seeds changed",
          "[plan]") {
  std::mt19937_64 engine(7);
  for (int set = 0; set < 20; ++set) {
    std::vector<int> counts;
    const std::size_t factors = 3 + engine() % 8;
    for (std::size_t i = 0; i < factors; ++i) counts.push_back(2 + static_cast<int>(engine() % 4));
    const Design design = all_pairs(Constraints(counts, {}), engine());
    CAPTURE(set, design.rows.size());
    CHECK(pairs_missing(design) == 0);
  }
}

TEST_CASE("no test contains a forbidden combination, and all other pairs occur", "[plan]") {
  // Level 0 of factor 0 never with level 1 of factor 1; three levels never together; factor 2 at 2
  // forces factor 3 to 0, which excludes two pairs implicitly.
  const std::vector<Forbidden> forbidden{
      {{0, 0}, {1, 1}}, {{0, 1}, {1, 1}, {2, 1}}, {{2, 2}, {3, 1}}, {{2, 2}, {3, 2}}};
  const Constraints constraints({3, 3, 3, 3}, forbidden);
  const Design design = all_pairs(constraints, 3);
  for (const auto& row : design.rows) CHECK(constraints.kept_by(row));
  const PairCount pairs = count_pairs(design, constraints);
  CHECK(pairs.impossible == 3);
  CHECK(pairs.covered == pairs.possible);
  CHECK(pairs_missing(design) == 3);
}

TEST_CASE("constraints that allow no test are refused", "[plan]") {
  const Constraints nothing({2, 2}, {{{0, 0}}, {{0, 1}}});
  CHECK_THROWS_WITH(all_pairs(nothing, 1), Catch::Contains("exclude every test"));
}

TEST_CASE("four factors of three levels give L9, with a fifth an array or all pairs", "[plan]") {
  FactorsSpec spec;
  for (int i = 0; i < 4; ++i)
    spec.factors.push_back({std::string("f").append(std::to_string(i)), {"a", "b", "c"}});
  const TestPlan plan = make_plan(spec);
  CHECK(plan.design.name == "L9 (3^4)");
  CHECK(plan.strength == 2);
  CHECK(plan.levels_balanced);
  spec.factors.push_back({"f4", {"a", "b", "c"}});
  CHECK_THAT(make_plan(spec).design.name, Catch::StartsWith("L18"));
  spec.method = Method::all_pairs;
  const TestPlan pairs = make_plan(spec);
  CHECK(pairs.design.rows.size() <= 12);
  CHECK(pairs.pairs.covered == pairs.pairs.possible);
}

TEST_CASE("a factor with fewer levels than its column is reported", "[plan]") {
  FactorsSpec spec = parse_factors(
      std::string("method = \"orthogonal\"\narray = \"L9\"\n").append(two_factors), "f");
  const TestPlan plan = make_plan(spec);
  CHECK(plan.dummy_levels);
  CHECK_FALSE(plan.levels_balanced);
  CHECK_THAT(plan_text(plan), Catch::Contains("twice as often"));
}

TEST_CASE("a run file skeleton is a valid run file with the stops", "[plan]") {
  FactorsSpec spec = parse_factors(two_factors, "f");
  spec.test.hours = 6;
  const TestPlan plan = make_plan(spec);
  const RunFile run = parse_run(run_file_skeleton(plan, 0), "skeleton");
  CHECK(run.rows() == 37);
  const auto& running = run.column("running_on");
  CHECK(running[0] == 0.0);
  CHECK(running[6] == 1.0);  // 60 min
  CHECK(running[7] == 0.0);  // 70 min: in the stop of 10 min
  CHECK(running[8] == 1.0);
  CHECK(std::count(running.begin(), running.end(), 0.0) == 1 + 1 + 6 + 2);
  CHECK_THAT(test_sheet(plan), Catch::Contains("| 3:00 | stop for 60 min |"));
}

TEST_CASE("the sheet states for each test whether the tool cuts", "[plan]") {
  const std::string all = test_sheet(make_plan(parse_factors(two_factors, "f")));
  CHECK_THAT(all, Catch::Contains("Actual cutting") && !Catch::Contains("dummy"));
  const std::string simulated =
      std::string(two_factors).append("[test]\ncutting = \"simulated\"\n");
  const TestPlan plan = make_plan(parse_factors(simulated, "f"));
  CHECK_THAT(test_sheet(plan), Catch::Contains("dummy") && !Catch::Contains("Actual cutting"));
  CHECK_THAT(run_file_skeleton(plan, 0), Catch::Contains("# cutting = simulated"));
}

TEST_CASE("as a factor, cutting is stated for each test", "[plan]") {
  const std::string text =
      std::string(two_factors)
          .append("[[factor]]\nname = \"cutting\"\nlevels = [\"actual\", \"simulated\"]\n");
  const TestPlan plan = make_plan(parse_factors(text, "f"));
  const std::string sheet = test_sheet(plan);
  for (std::size_t place = 0; place < plan.order.size(); ++place) {
    const std::size_t begin = sheet.find("\n## " + std::to_string(place + 1) + ". ");
    const std::string of_test = sheet.substr(begin, sheet.find("\n## ", begin + 1) - begin);
    const bool cuts = plan.design.rows[plan.order[place]][2] == 0;
    CAPTURE(of_test);
    CHECK((of_test.find("Actual cutting") != std::string::npos) == cuts);
    CHECK((of_test.find("Simulated cutting") != std::string::npos) != cuts);
  }
  CHECK_THROWS_WITH(parse_factors(text + "[test]\ncutting = \"actual\"\n", "f"),
                    Catch::Contains("must be omitted if a factor is named cutting"));
  const std::string dry =
      std::string(two_factors)
          .append("[[factor]]\nname = \"cutting\"\nlevels = [\"actual\", \"dry\"]\n");
  CHECK_THROWS_WITH(parse_factors(dry, "f"), Catch::Contains("dry"));
}

TEST_CASE("a factors file with faults names every one of them", "[plan]") {
  const std::string text = R"(
array = "L7"
unknown = 1
[[factor]]
name = "a"
levels = [1, 1]
[[factor]]
name = "a"
levels = ["x"]
[[forbidden]]
when = { b = 1 }
[test]
hours = 4
[[test.stop]]
after_h = 3.9
pause_min = 30
)";
  try {
    (void)parse_factors(text, "factors.toml");
    FAIL("accepted");
  } catch (const ConfigurationError& error) {
    const std::string all = error.what();
    for (const char* part : {"L4, L8", "unknown", "occurs twice", "is used twice", "2 to 30",
                             "name of a factor", "end within the test"})
      CHECK_THAT(all, Catch::Contains(part));
  }
}

}  // namespace

TEST_CASE("the sheet lists rough cuts, one finishing cut, then the measurement", "[plan]") {
  const std::string each = std::string(two_factors).append("[test]\nrough_cuts = 3\n");
  CHECK_THAT(
      test_sheet(make_plan(parse_factors(each, "f"))),
      Catch::Contains("3 rough cuts, one finishing cut, tool back at its origin, then measure"));
  const std::string factor =
      std::string(two_factors).append("[[factor]]\nname = \"rough_cuts\"\nlevels = [1, 5]\n");
  const std::string sheet = test_sheet(make_plan(parse_factors(factor, "f")));
  CHECK_THAT(sheet, Catch::Contains("1 rough cut, one finishing") &&
                        Catch::Contains("5 rough cuts, one finishing"));
  CHECK_THAT(test_sheet(make_plan(parse_factors(two_factors, "f"))),
             !Catch::Contains("finishing cut"));
}

}  // namespace thermocomp::experiments
