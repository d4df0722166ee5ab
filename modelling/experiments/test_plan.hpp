/// File of factors for `thermocomp plan` (commented example: config/examples/factors.toml); the
/// test plan from them, its verified properties, and its papers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "modelling/experiments/designs.hpp"

namespace thermocomp::experiments {

enum class Method { automatic, orthogonal, all_pairs };

struct Factor {
  std::string name;
  std::vector<std::string> levels;  ///< as written; numbers in shortest form
};

/// A planned standstill, from the test's start.
struct Stop {
  double after_h{0.0};
  double pause_min{0.0};
};

/// The tool cuts, or makes the same motion beside a dummy workpiece.
enum class Cutting { actual, simulated };

struct TestSpec {
  double hours{8.0};
  double row_every_min{10.0};
  std::vector<std::string> temperatures;  ///< columns of the run files
  std::vector<std::string> outputs;
  std::vector<Stop> stops;  ///< in order
  int rough_cuts{0};        ///< of a cycle, before one finishing cut; 0: not given
  std::optional<std::size_t> rough_cuts_factor;  ///< factor that sets it for each test
  Cutting cutting{Cutting::actual};
  std::optional<std::size_t> cutting_factor;  ///< factor that sets it for each test
};

struct FactorsSpec {
  Method method{Method::automatic};
  std::string array;  ///< empty: the smallest fitting one
  std::uint64_t seed{1};
  std::vector<Factor> factors;
  std::vector<Forbidden> forbidden;
  TestSpec test;

  [[nodiscard]] std::vector<int> level_counts() const;
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] FactorsSpec load_factors(const std::filesystem::path& path);
/// @param name file name for problems
[[nodiscard]] FactorsSpec parse_factors(const std::string& text, const std::string& name);

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
