/// Places that warm in groups: each group follows its own mixture of heat sources with its own time
/// constant, each place with its own gain.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::identification {

inline double gaussian(std::mt19937_64& engine) {
  const auto share = [&] { return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53; };
  return std::sqrt(-2.0 * std::log(share())) * std::cos(2.0 * M_PI * share());
}

/// `sizes[g]` places of group g; tests of 8 h, one row per minute, each with its own spindle load,
/// coolant and room.
inline MeasuredTests grouped_places(const std::vector<std::size_t>& sizes, double noise_K,
                                    std::uint64_t seed, std::size_t tests_count = 9) {
  std::mt19937_64 engine(seed);
  MeasuredTests tests;
  std::vector<std::size_t> group_of;
  std::vector<double> size_of;
  for (std::size_t group = 0; group < sizes.size(); ++group)
    for (std::size_t i = 0; i < sizes[group]; ++i) {
      group_of.push_back(group);
      size_of.push_back(0.6 + 0.1 * static_cast<double>(i));
      tests.places.push_back(std::string("t").append(std::to_string(tests.places.size() + 1)));
      tests.places.back().append("_degC");
    }
  constexpr Eigen::Index rows = 480;
  for (std::size_t t = 0; t < tests_count; ++t) {
    TestRun& run = tests.runs.emplace_back();
    run.name = std::string("test").append(std::to_string(t));
    run.time_s = Eigen::VectorXd::LinSpaced(rows, 0.0, 60.0 * (rows - 1));
    run.places_K.resize(rows, static_cast<Eigen::Index>(group_of.size()));
    std::vector<double> state(sizes.size(), 0.0);
    const double spindle = 4.0 + static_cast<double>(t % 3) * 4.0;
    const double coolant = -2.0 + std::floor(static_cast<double>(t) / 3.0) * 3.0;
    const double room = 1.0 + static_cast<double>((t * 2) % 3);
    for (Eigen::Index row = 0; row < rows; ++row) {
      const bool running = row % 200 < 150;
      for (std::size_t g = 0; g < sizes.size(); ++g) {
        const double tau_min = 12.0 * std::pow(1.9, static_cast<double>(g % 4));
        const auto mixture = static_cast<double>(g) / static_cast<double>(sizes.size());
        const double heat = (1.0 - mixture) * (running ? spindle : 0.0) + mixture * coolant +
                            room * std::sin(0.01 * static_cast<double>(row) + mixture * 3.0);
        state[g] += (heat - state[g]) / tau_min;
      }
      for (std::size_t p = 0; p < group_of.size(); ++p)
        run.places_K(row, static_cast<Eigen::Index>(p)) =
            size_of[p] * state[group_of[p]] + noise_K * gaussian(engine);
    }
    run.places_K.rowwise() -= run.places_K.row(0).eval();
    run.outputs_um.resize(rows, 0);
    tests.folds.push_back({t, 0, rows});
  }
  return tests;
}

/// Adds an output that is a sum of places with coefficients, and noise.
inline void add_output(MeasuredTests& tests, const std::string& name,
                       const std::vector<std::pair<std::size_t, double>>& terms, double noise_um,
                       std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  tests.outputs.push_back(name);
  for (TestRun& run : tests.runs) {
    Eigen::VectorXd values = Eigen::VectorXd::Zero(run.time_s.size());
    for (const auto& [place, um_per_K] : terms)
      values += um_per_K * run.places_K.col(static_cast<Eigen::Index>(place));
    for (Eigen::Index row = 0; row < values.size(); ++row)
      values[row] += noise_um * gaussian(engine);
    run.outputs_um.conservativeResize(Eigen::NoChange, run.outputs_um.cols() + 1);
    run.outputs_um.rightCols(1) = values;
  }
}

}  // namespace thermocomp::identification
