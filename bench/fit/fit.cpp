// Every combination of up to 6 of 22 places, evaluated by leaving out each of 9 tests of 480 rows.
// `bench_fit FILE` writes the rows as doubles (tests, rows, 22 places and the output) for numpy,
// then measures normal equations and search, the best of several rounds. Prints for each number of
// terms the lowest score and its places; last line: seconds.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>

#include "modelling/identification/equation/subset_search.hpp"

namespace {

using namespace thermocomp::identification;

constexpr Eigen::Index places = 22;
constexpr Eigen::Index rows = 480;
constexpr std::size_t tests_count = 9;
constexpr int rounds = 5;

/// Places that follow three heat sources with different time constants and sizes.
MeasuredTests make_tests() {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> noise;
  MeasuredTests tests;
  tests.outputs = {"z_um"};
  for (Eigen::Index p = 0; p < places; ++p)
    tests.places.push_back(std::string("t").append(std::to_string(p + 1)).append("_degC"));
  std::vector<std::array<double, 4>> nature;
  for (Eigen::Index p = 0; p < places; ++p)
    nature.push_back({noise(engine), noise(engine), noise(engine),
                      10.0 * std::exp(0.8 * std::abs(noise(engine)))});
  for (std::size_t t = 0; t < tests_count; ++t) {
    TestRun& run = tests.runs.emplace_back();
    run.name = std::string("test ").append(std::to_string(t + 1));
    run.time_s = Eigen::VectorXd::LinSpaced(rows, 0, 60.0 * (rows - 1));
    run.places_K = Eigen::MatrixXd::Zero(rows, places);
    run.outputs_um = Eigen::MatrixXd::Zero(rows, 1);
    const double load = 3.0 + noise(engine);
    for (Eigen::Index row = 1; row < rows; ++row) {
      const double spindle = row % 120 < 90 ? load : 0.0;
      const double room = std::sin(0.005 * static_cast<double>(row) + static_cast<double>(t));
      for (Eigen::Index p = 0; p < places; ++p) {
        const auto& n = nature[static_cast<std::size_t>(p)];
        const double heat = n[0] * spindle + n[1] * room + n[2];
        const double before = run.places_K(row - 1, p);
        run.places_K(row, p) = before + (heat - before) / n[3];
      }
    }
    for (Eigen::Index row = 0; row < rows; ++row) {
      for (Eigen::Index p = 0; p < places; ++p) run.places_K(row, p) += 0.03 * noise(engine);
      run.outputs_um(row, 0) = 5.4 * run.places_K(row, 5) + 0.5 * run.places_K(row, 11) -
                               4.8 * run.places_K(row, 7) + 0.3 * run.places_K(row, 13) +
                               0.5 * noise(engine);
    }
    tests.folds.push_back({t, 0, rows});
  }
  return tests;
}

void write_rows(const MeasuredTests& tests, const char* file) {
  std::ofstream out(file, std::ios::binary);
  for (const TestRun& run : tests.runs)
    for (Eigen::Index row = 0; row < rows; ++row) {
      for (Eigen::Index p = 0; p < places; ++p)
        out.write(reinterpret_cast<const char*>(&run.places_K(row, p)), sizeof(double));
      out.write(reinterpret_cast<const char*>(&run.outputs_um(row, 0)), sizeof(double));
    }
}

}  // namespace

int main(int argc, char** argv) {
  const MeasuredTests tests = make_tests();
  if (argc > 1) write_rows(tests, argv[1]);
  SubsetOptions options;
  options.terms_min = 1;
  options.terms_max = 6;
  double best_s = INFINITY;
  SubsetSearch search;
  for (int round = 0; round < rounds; ++round) {
    const auto start = std::chrono::steady_clock::now();
    search = search_subsets(normal_equations(tests, 0.0), options);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    best_s = std::min(best_s, took.count());
  }
  std::printf("judged %llu\n", static_cast<unsigned long long>(search.judged));
  for (std::size_t terms = 1; terms <= 6; ++terms) {
    const Subset& best = search.best[terms].front();
    std::printf("best %zu %.12e", terms, best.score);
    for (const std::size_t place : best.places) std::printf(" %zu", place);
    std::printf("\n");
  }
  std::printf("seconds %.6f\n", best_s);
}
