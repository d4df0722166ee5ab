/// Sensor positions by tendency patterns: which uniform block temperatures would have given the
/// displacement of the full field, and where in each block they are found.
/// Source: JP6507619B2, the claim; steps are counted as in docs/placement.md.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// How a tendency is found to be the nearest in shape to what is needed. Curves along a guideway
/// are compared by quadratics a X^2 + b X + c; a single output is its c.
enum class Way {
  coefficients,  ///< scaled to one size, coefficient by coefficient, the largest first
  ratios,        ///< of the coefficients to the largest one
  difference     ///< least sum of squares between the curves scaled to one size
};
[[nodiscard]] std::string_view name_of(Way way);
inline constexpr std::array<Way, 3> all_ways{Way::coefficients, Way::ratios, Way::difference};

/// With which temperatures the iteration begins.
enum class Start { mean, median, centroid };

struct TendencyOptions {
  Start start{Start::mean};
  double threshold_um{0.01};  ///< the error at which the iteration stops
  int rounds_max{200};
};

struct TendencyRound {
  std::string pattern;  ///< "cooler half +10 %"
  int rank{0};          ///< 1: the nearest in shape; more where nearer ones made nothing better
  double rho{0.0};
  double error_um{0.0};  ///< RMS over the outputs, after the round
};

struct TendencyRun {
  double error_um_at_start{0.0};
  std::vector<TendencyRound> rounds;
  std::string ended;  ///< why
  Numbers blocks_K;   ///< theta_g, shape (blocks)
};

/// Steps 2 to 10 for one temperature field.
[[nodiscard]] TendencyRun run_tendencies(const PlacementProblem& problem, const Field& field,
                                         Way way, const TendencyOptions& options);

struct TendencyPlacement {
  Way way{};
  std::vector<TendencyRun> runs;  ///< one for each used field
  std::vector<Index> sensors;     ///< one node per block
};

/// Step 11: in each block the node whose temperatures are nearest to theta_g; over several fields
/// the least sum of squares.
[[nodiscard]] TendencyPlacement place_by_tendencies(const PlacementProblem& problem, Way way,
                                                    const TendencyOptions& options);

}  // namespace thermocomp::placement
