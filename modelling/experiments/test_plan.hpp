/// From factors to tests, what the plan promises, and the papers that go with it.
#pragma once

#include <string>

#include "modelling/experiments/all_pairs.hpp"
#include "modelling/experiments/factors_file.hpp"

namespace thermocomp::experiments {

struct TestPlan {
  FactorsSpec spec;
  Design design;
  std::vector<std::size_t> order;  ///< in which the tests are to be run: drawn by the seed
  bool dummy_levels{false};
  // verified on the finished plan, whatever made it
  int strength{0};
  bool levels_balanced{false};  ///< every level of a factor equally often
  PairCount pairs;
};

/// `automatic` takes the smallest orthogonal array that fits without dummy levels where nothing is
/// forbidden, and all pairs otherwise.
/// @throws std::runtime_error when no array fits, or nothing is allowed
[[nodiscard]] TestPlan make_plan(const FactorsSpec& spec);

/// Tests with their levels, strength and balance, for a person.
[[nodiscard]] std::string plan_text(const TestPlan& plan);
[[nodiscard]] std::string plan_json(const TestPlan& plan);
/// The plan as CSV: test, then one column per factor.
[[nodiscard]] std::string plan_csv(const TestPlan& plan);
/// What to do in the workshop, test by test, with the planned stops (Markdown).
[[nodiscard]] std::string test_sheet(const TestPlan& plan);
/// A run file whose temperatures and displacements are to be filled in. @param test from 0
[[nodiscard]] std::string run_file_skeleton(const TestPlan& plan, std::size_t test);

}  // namespace thermocomp::experiments
