/// Test plan from factors, its verified properties, and its papers.
#pragma once

#include <string>

#include "modelling/experiments/all_pairs.hpp"
#include "modelling/experiments/factors_file.hpp"

namespace thermocomp::experiments {

struct TestPlan {
  FactorsSpec spec;
  Design design;
  std::vector<std::size_t> order;  ///< order of the tests, drawn by the seed
  bool dummy_levels{false};
  // verified on the finished plan
  int strength{0};
  bool levels_balanced{false};  ///< every level of a factor equally often
  PairCount pairs;
};

/// `automatic` uses the smallest orthogonal array that fits without dummy levels if nothing is
/// forbidden, else all pairs.
/// @throws std::runtime_error if no array fits, or no test is allowed
[[nodiscard]] TestPlan make_plan(const FactorsSpec& spec);

/// Text with the tests' levels, strength and balance.
[[nodiscard]] std::string plan_text(const TestPlan& plan);
[[nodiscard]] std::string plan_json(const TestPlan& plan);
/// The plan as CSV: test, then one column per factor.
[[nodiscard]] std::string plan_csv(const TestPlan& plan);
/// Instructions for the workshop, test by test, with the planned stops (Markdown).
[[nodiscard]] std::string test_sheet(const TestPlan& plan);
/// A run file with empty temperatures and displacements. @param test from 0
[[nodiscard]] std::string run_file_skeleton(const TestPlan& plan, std::size_t test);

}  // namespace thermocomp::experiments
