// Tests of the method of tendency patterns and of the other methods.
#include <algorithm>
#include <cmath>
#include <set>

#include <nlohmann/json.hpp>

#include "machines.hpp"
#include "modelling/placement/tendency_method.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace thermocomp::placement;

namespace {

bool one_in_each_block(const PlacementProblem& problem, const std::vector<Index>& sensors) {
  if (sensors.size() != problem.blocks.size()) return false;
  for (std::size_t b = 0; b < sensors.size(); ++b) {
    const auto& candidates = problem.blocks[b].candidates;
    if (std::find(candidates.begin(), candidates.end(), sensors[b]) == candidates.end()) {
      return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("a quadratic through its own points is found exactly", "[placement]") {
  const std::vector<double> at{-1.0, -0.5, 0.0, 0.5, 1.0};
  std::vector<double> values;
  for (const double x : at) values.push_back(3.0 * x * x - 2.0 * x + 0.5);
  const auto fit = fit_quadratic(at, values);
  CHECK(fit[0] == Approx(3.0));
  CHECK(fit[1] == Approx(-2.0));
  CHECK(fit[2] == Approx(0.5));
  const auto line = fit_quadratic({at.data(), 2}, std::vector<double>{1.0, 2.0});
  CHECK(line[0] == 0.0);
  CHECK(line[1] == Approx(2.0));
}

TEST_CASE("placements are judged by the displacement of the full field", "[placement]") {
  const Machine machine = machine_of(column + cooled + heater + cases);
  const PlacementProblem problem = problem_of(machine);
  const structure::Statics statics = statics_of(machine);
  REQUIRE(problem.curves.size() == 2);
  REQUIRE(problem.rows() == 5);  // four along the guideway, z
  for (const Field& field : problem.used) {
    const auto displacement_m = statics.displacement_m(field.rise_K);
    CHECK(field.displacement_um[4] == Approx(1e6 * machine.built.rows[1].of(displacement_m)));
    for (std::size_t i = 0; i < 4; ++i) {
      const double x_um = 1e6 * machine.built.rows[2 + i].of(displacement_m);
      CHECK(field.displacement_um[i] == Approx(x_um).margin(1e-9));
    }
  }
}

TEST_CASE("a field that is uniform in each block needs no rounds", "[placement][tendency]") {
  const Machine machine = machine_of(column + cooled + heater + cases);
  PlacementProblem problem = problem_of(machine);
  Field& field = problem.used.front();
  for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
    for (const Index node : problem.blocks[b].nodes) field.rise_K[node] = 1.0 + double(b);
  }
  field.displacement_um = block_displacement_um(problem, block_means_K(problem, field.rise_K));
  for (const Way way : all_ways) {
    const TendencyRun run = run_tendencies(problem, field, way, {});
    CHECK(run.rounds.empty());
    CHECK(run.ended == "the error is below the threshold");
  }
}

TEST_CASE("every round reduces the error within the blocks' readings and states how it ends",
          "[placement][tendency]") {
  const PlacementProblem problem = problem_of(machine_of(column + cooled + heater + cases));
  for (const Way way : all_ways) {
    for (const Start start : {Start::mean, Start::median, Start::centroid}) {
      for (const Field& field : problem.used) {
        CAPTURE(name_of(way), field.time_s);
        const TendencyRun run = run_tendencies(problem, field, way, {start, 1e-4, 200});
        CHECK_FALSE(run.ended.empty());
        double error_um = run.error_um_at_start;
        for (const TendencyRound& round : run.rounds) {
          CHECK(round.error_um < error_um);
          error_um = round.error_um;
        }
        const Numbers found_um = block_displacement_um(problem, run.blocks_K);
        Numbers error = field.displacement_um;
        for (std::size_t i = 0; i < error.size(); ++i) error[i] -= found_um[i];
        CHECK(rms_um(problem, error) == Approx(error_um).margin(1e-12));
        for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
          std::vector<double> readings;
          for (const Index node : problem.blocks[b].candidates) {
            readings.push_back(field.rise_K[node]);
          }
          const auto [low, high] = std::minmax_element(readings.begin(), readings.end());
          CHECK(run.blocks_K[b] >= *low);
          CHECK(run.blocks_K[b] <= *high);
        }
      }
    }
  }
}

TEST_CASE("placements beat the mean of the block in the fields that they were made for",
          "[placement]") {
  const PlacementProblem problem =
      problem_of(machine_of(column + cooled + heater + cases + left_out));
  REQUIRE(problem.used.size() == 4);
  REQUIRE(problem.left_out.size() == 1);
  const Comparison comparison = compare_placements(problem, {}, [](std::string_view) {});
  const double mean_um = comparison.method("mean_of_block").used.rms_um;
  const double random_um = comparison.method("random").used.rms_um;
  for (const Way way : all_ways) {
    const auto& result = comparison.method(std::string("tendency_").append(name_of(way)));
    CAPTURE(result.name);
    CHECK(result.used.rms_um < 0.75 * random_um);
    CHECK(result.used.rms_um >= comparison.method("greedy").used.rms_um);
    CHECK(one_in_each_block(problem, result.sensors));
  }
  const Way best = comparison.ways[comparison.best_way].way;
  CHECK(comparison.method(std::string("tendency_").append(name_of(best))).used.rms_um <
        0.5 * mean_um);
  CHECK(comparison.method("greedy").used.rms_um < 0.5 * mean_um);
  CHECK(one_in_each_block(problem, comparison.method("greedy").sensors));
  CHECK(one_in_each_block(problem, comparison.method("qr_pivoting").sensors));
  CHECK(comparison.method("qr_reconstruction").used.rms_um < 1e-6);  // four fields, four sensors
  const std::string message = recommendation_text(problem, comparison);
  CHECK(message.find("(not the daemon's model)") != std::string::npos);
  CHECK(message.find(remaining_text(problem, comparison)) != std::string::npos);
  CHECK(comparison.greedy.steps.back().error_um ==
        Approx(comparison.method("greedy").used.rms_um).epsilon(1e-6));
}

TEST_CASE("a load case that is left out does not affect the placement", "[placement]") {
  const auto text = [](const std::string& change) {
    std::string other = left_out;
    other.replace(other.find("-2"), 2, change);
    return column + cooled + heater + cases + other;
  };
  const PlacementProblem problem = problem_of(machine_of(text("-2")));
  const PlacementProblem other = problem_of(machine_of(text("+9")));
  const Comparison a = compare_placements(problem, {}, [](std::string_view) {});
  const Comparison b = compare_placements(other, {}, [](std::string_view) {});
  for (std::size_t i = 0; i < a.methods.size(); ++i) {
    CHECK(a.methods[i].sensors == b.methods[i].sensors);
    CHECK(a.methods[i].used.rms_um == b.methods[i].used.rms_um);
  }
  CHECK(a.uncompensated.left_out.rms_um != Approx(b.uncompensated.left_out.rms_um));
}

TEST_CASE("sensors are on the free surface, or anywhere if requested", "[placement]") {
  const std::string text = column + cooled + heater + cases;
  const auto inner_candidates = [](const PlacementProblem& problem) {
    std::size_t inner = 0;
    for (const BlockOfSensors& block : problem.blocks) {
      for (const Index node : block.candidates) {
        const Vec3& at = problem.nodes_m[node];
        bool outside = false;
        for (std::size_t d = 0; d < 3; ++d) {
          const double size_m = d == 2 ? 0.4 : 0.1;
          outside = outside || at[d] < 1e-9 || at[d] > size_m - 1e-9;
        }
        inner += outside ? 0 : 1;
      }
    }
    return inner;
  };
  CHECK(inner_candidates(problem_of(machine_of(text))) == 0);
  CHECK(inner_candidates(problem_of(machine_of(text + "[placement]\non_surface = false\n"))) > 0);
}

TEST_CASE("the random placement depends on the seed only", "[placement]") {
  const PlacementProblem problem = problem_of(machine_of(column + cooled + heater + cases));
  CHECK(place_at_random(problem, 7) == place_at_random(problem, 7));
  CHECK(place_at_random(problem, 7) != place_at_random(problem, 8));
}

TEST_CASE("the report for programs has sensors, errors before and after, and the history",
          "[placement]") {
  const PlacementProblem problem =
      problem_of(machine_of(column + cooled + heater + cases + left_out));
  const Comparison comparison = compare_placements(problem, {}, [](std::string_view) {});
  const auto json = nlohmann::json::parse(comparison_json(problem, comparison));
  CHECK(json.at("load_cases").at(2).at("left_out") == true);
  const auto& greedy = json.at("methods").at("greedy");
  CHECK(greedy.at("sensors").at(0).at("block") == "left_low_degC");
  CHECK(greedy.at("sensors").at(0).at("at_mm").size() == 3);
  CHECK(greedy.at("used").at("rms_um") < json.at("uncompensated").at("used").at("rms_um"));
  CHECK(greedy.at("load_cases").contains("both"));
  const auto& run = json.at("tendency").at("history").at("ratios").at(0);
  CHECK(run.at("blocks").at("left_high_degC").contains("wanted_K"));
  CHECK_FALSE(run.at("ended").get<std::string>().empty());
  const std::string text = comparison_text(problem, comparison);
  CHECK(text.find("sensors by greedy:") != std::string::npos);
  CHECK(text.find("left out") != std::string::npos);
}

TEST_CASE("the median of an even number is the mean of the two middle values", "[placement]") {
  CHECK(median_of({4.0, 1.0, 9.0, 2.0}) == 3.0);  // not 4
  CHECK(median_of({4.0, 1.0, 9.0}) == 4.0);
}
