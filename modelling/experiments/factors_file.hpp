/// File of factors for `thermocomp plan`; commented example: config/examples/factors.toml.
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

}  // namespace thermocomp::experiments
