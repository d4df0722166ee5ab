/// The file of factors from which `thermocomp plan` makes tests. Its commented example:
/// config/examples/factors.toml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "modelling/experiments/all_pairs.hpp"

namespace thermocomp::experiments {

enum class Method { automatic, orthogonal, all_pairs };

struct Factor {
  std::string name;
  std::vector<std::string> levels;  ///< as written; numbers as their shortest text
};

/// A planned standstill, counted from the test's start.
struct Stop {
  double after_h{0.0};
  double pause_min{0.0};
};

/// The tool cuts, or moves as if it did beside a dummy workpiece.
enum class Cutting { actual, simulated };

struct TestSpec {
  double hours{8.0};
  double row_every_min{10.0};
  std::vector<std::string> temperatures;  ///< columns of the run files
  std::vector<std::string> outputs;
  std::vector<Stop> stops;  ///< in order
  int rough_cuts{0};        ///< of a cycle, before one finishing cut; 0: not said
  std::optional<std::size_t> rough_cuts_factor;  ///< the factor that says it test by test
  Cutting cutting{Cutting::actual};
  std::optional<std::size_t> cutting_factor;  ///< the factor that says it test by test
};

struct FactorsSpec {
  Method method{Method::automatic};
  std::string array;  ///< empty: the smallest that fits
  std::uint64_t seed{1};
  std::vector<Factor> factors;
  std::vector<Forbidden> forbidden;
  TestSpec test;

  [[nodiscard]] std::vector<int> level_counts() const;
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] FactorsSpec load_factors(const std::filesystem::path& path);
/// @param name stands for the file in problems
[[nodiscard]] FactorsSpec parse_factors(const std::string& text, const std::string& name);

}  // namespace thermocomp::experiments
