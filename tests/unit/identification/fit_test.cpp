#include "modelling/identification/equation/fit.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <Eigen/QR>
#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "synthetic_places.hpp"

namespace thermocomp::identification {
namespace {

const std::vector<std::size_t> few_places{3, 2, 1, 1, 1};

MeasuredTests few_tests(double noise_um) {
  MeasuredTests tests = grouped_places(few_places, 0.02, 5, 5);
  add_output(tests, "z_um", {{1, 5.37}, {4, 0.5}, {6, -4.83}}, noise_um, 9);
  return tests;
}

/// The left-out sum of squares of a subset by QR on the rows themselves, relative to no model.
double score_by_rows(const MeasuredTests& tests, const std::vector<std::size_t>& places) {
  double left = 0.0;
  double whole = 0.0;
  for (std::size_t f = 0; f < tests.folds.size(); ++f) {
    Eigen::MatrixXd x(0, static_cast<Eigen::Index>(places.size()));
    Eigen::VectorXd y;
    const auto rows_of = [&](std::size_t t) {
      Eigen::MatrixXd block(tests.runs[t].time_s.size(), x.cols());
      for (std::size_t i = 0; i < places.size(); ++i)
        block.col(static_cast<Eigen::Index>(i)) =
            tests.runs[t].places_K.col(static_cast<Eigen::Index>(places[i]));
      return block;
    };
    for (std::size_t t = 0; t < tests.runs.size(); ++t) {
      if (t == f) continue;
      const Eigen::MatrixXd block = rows_of(t);
      const Eigen::Index before = x.rows();
      x.conservativeResize(before + block.rows(), Eigen::NoChange);
      x.bottomRows(block.rows()) = block;
      y.conservativeResize(before + block.rows());
      y.tail(block.rows()) = tests.runs[t].outputs_um.col(0);
    }
    const Eigen::VectorXd b = x.colPivHouseholderQr().solve(y);
    left += (tests.runs[f].outputs_um.col(0) - rows_of(f) * b).squaredNorm();
    whole += tests.runs[f].outputs_um.col(0).squaredNorm();
  }
  return left / whole;
}

TEST_CASE("the search scores every combination like least squares on the rows", "[fit]") {
  const MeasuredTests tests = few_tests(0.5);
  SubsetOptions options;
  options.terms_min = 1;
  options.terms_max = 4;
  options.kept = 1000;
  const SubsetSearch search = search_subsets(normal_equations(tests, 0.0), options);
  CHECK(search.judged == 8 + 28 + 56 + 70);
  CHECK(static_cast<double>(search.judged) == combinations(8, 1, 4));
  for (std::size_t terms = 1; terms <= 4; ++terms)
    for (const Subset& subset : search.best[terms]) {
      CAPTURE(subset.places);
      CHECK(subset.score == Approx(score_by_rows(tests, subset.places)).epsilon(1e-6));
    }
}

TEST_CASE("odd and large numbers of tests give the same scores", "[fit]") {
  const std::size_t count = GENERATE(std::size_t{2}, std::size_t{3}, std::size_t{14});
  MeasuredTests tests = grouped_places(few_places, 0.02, 5, count);
  add_output(tests, "z_um", {{1, 5.0}, {6, -4.0}}, 0.5, 3);
  SubsetOptions options;
  options.terms_min = options.terms_max = 2;
  options.kept = 100;
  const SubsetSearch search = search_subsets(normal_equations(tests, 0.0), options);
  REQUIRE(search.best[2].size() == 28);
  for (const Subset& subset : search.best[2])
    CHECK(subset.score == Approx(score_by_rows(tests, subset.places)).epsilon(1e-6));
}

TEST_CASE("the publication's rules allow two places per group and require one of the largest",
          "[fit]") {
  const MeasuredTests tests = few_tests(0.5);
  SubsetOptions options;
  options.terms_min = 1;
  options.terms_max = 4;
  options.kept = 1000;
  options.group_of = {0, 0, 0, 1, 1, 2, 3, 4};
  std::size_t expected = 0;
  for (unsigned mask = 1; mask < 256; ++mask) {
    const int first = __builtin_popcount(mask & 7u);
    if (__builtin_popcount(mask) <= 4 && first >= 1 && first <= 2) ++expected;
  }
  const SubsetSearch search = search_subsets(normal_equations(tests, 0.0), options);
  CHECK(search.judged == expected);
  for (const auto& subsets : search.best)
    for (const Subset& subset : subsets) {
      const auto of_first = std::count_if(subset.places.begin(), subset.places.end(),
                                          [](std::size_t place) { return place < 3; });
      CHECK(of_first >= 1);
      CHECK(of_first <= 2);
    }
}

TEST_CASE("a place that is the sum of two others is not combined with both", "[fit]") {
  MeasuredTests tests = few_tests(0.5);
  for (TestRun& run : tests.runs) run.places_K.col(7) = run.places_K.col(5) + run.places_K.col(6);
  SubsetOptions options;
  options.terms_min = options.terms_max = 3;
  options.kept = 1000;
  const SubsetSearch search = search_subsets(normal_equations(tests, 0.0), options);
  REQUIRE_FALSE(search.best[3].empty());
  for (const Subset& subset : search.best[3])
    CHECK(subset.places != std::vector<std::size_t>{5, 6, 7});
}

TEST_CASE("the places and coefficients that made the data are found", "[fit]") {
  const MeasuredTests tests = few_tests(0.3);
  FitOptions options;
  options.choice = Choice::free;
  options.terms_min = 1;
  const Fit fit = fit_equation(tests, options);
  // 3 and 4 are of one group: with so small a coefficient noise decides between them.
  REQUIRE(fit.places.size() == 3);
  CHECK(fit.places[0] == 1);
  CHECK((fit.places[1] == 3 || fit.places[1] == 4));
  CHECK(fit.places[2] == 6);
  const OutputFit& output = fit.outputs.front();
  CHECK(std::abs(output.coefficients[0] - 5.37) < std::max(output.ci95[0], 0.05));
  CHECK(std::abs(output.coefficients[2] + 4.83) < std::max(output.ci95[2], 0.05));
  CHECK(output.left_out_rms_um == Approx(0.3).epsilon(0.1));
  CHECK(fit.warnings.empty());
  REQUIRE(fit.lost.size() == 3);
  CHECK(fit.lost[0].without_rms_um[0] > 3.0);
  // Another place of its group is nearly as good.
  CHECK(fit.lost[0].replacement <= 2);
  CHECK(fit.lost[0].replaced_rms_um[0] < 0.5);
}

TEST_CASE("two outputs share one choice of places", "[fit]") {
  MeasuredTests tests = few_tests(0.3);
  add_output(tests, "x_um", {{4, 3.0}, {7, 2.0}}, 0.3, 21);
  FitOptions options;
  options.choice = Choice::free;
  options.terms_min = 4;
  options.terms_max = 4;
  const Fit fit = fit_equation(tests, options);
  CHECK(fit.places == std::vector<std::size_t>{1, 4, 6, 7});
  CHECK(fit.outputs[1].left_out_rms_um == Approx(0.3).epsilon(0.1));
}

TEST_CASE("a lag is added if there is one, and not otherwise", "[fit]") {
  MeasuredTests tests = few_tests(0.3);
  FitOptions options;
  options.choice = Choice::free;
  options.terms_min = options.terms_max = 3;
  options.lags = true;
  CHECK(fit_equation(tests, options).columns.size() == 3);
  for (TestRun& run : tests.runs) run.outputs_um.col(0) += 3.0 * column_of(run, {1, 1500.0});
  const Fit fit = fit_equation(tests, options);
  REQUIRE(fit.columns.size() >= 4);
  CHECK(fit.columns[3].place == 1);
  CHECK(fit.columns[3].tau_s == Approx(1500.0).epsilon(0.5));
  const ThermalModel model = model_of(tests, fit);
  REQUIRE(!model.terms.empty());
  const std::string text = write_model(model);
  CHECK(write_model(parse_model(text, "fitted")) == text);
}

TEST_CASE("a model worse than none on a test has a warning", "[fit]") {
  MeasuredTests tests = few_tests(0.3);
  tests.runs[2].outputs_um *= -0.2;  // on this test every gain has the opposite sign
  FitOptions options;
  options.choice = Choice::free;
  const Fit fit = fit_equation(tests, options);
  REQUIRE(!fit.warnings.empty());
  CHECK_THAT(fit.warnings.front(), Catch::Contains("test2") && Catch::Contains("worse"));
}

TEST_CASE("rows with a missing value, constant places and absent ones are left out", "[fit]") {
  const std::string text =
      "time_s,a_degC,b_degC,c_degC,z_um\n0,nan,20,21,0\n60,20,20,21,1\n120,21,20,22,2\n"
      "180,22,20,,3\n240,23,20,24,4\n300,24,20,25,5\n360,25,20,26,7\n";
  std::vector<RunFile> runs{parse_run(text, "a.csv")};
  const MeasuredTests tests = measured_tests(runs, {{}, {"z_um"}, 2});
  CHECK(tests.places == std::vector<std::string>{"a_degC", "c_degC"});
  CHECK(tests.rows() == 5);
  CHECK(tests.runs[0].places_K(0, 0) == 0.0);
  CHECK(tests.runs[0].outputs_um(4, 0) == 6.0);
  REQUIRE(tests.folds.size() == 2);
  CHECK(tests.fold_name(1) == "a.csv@240:");
  CHECK(tests.notes.size() == 1);
  CHECK_THROWS_AS(measured_tests(runs, {{}, {"y_um"}, 2}), ConfigurationError);
  CHECK_THROWS_AS(measured_tests(runs, {{"z_um"}, {}, 2}), ConfigurationError);
  runs.push_back(parse_run("time_s,d_degC,z_um\n0,20,0\n60,21,1\n120,22,2\n", "b.csv"));
  CHECK_THROWS_WITH(measured_tests(runs, {{}, {"z_um"}, 2}),
                    Catch::Contains("a_degC is left out: not every run has it"));
}

}  // namespace
}  // namespace thermocomp::identification
