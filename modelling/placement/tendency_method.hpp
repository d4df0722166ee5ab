/// Sensor placement by tendency patterns: finds uniform block temperatures that give the
/// displacement of the full field, and the places in each block that have them.
/// Source: JP6507619B2, the claim; steps are numbered as in docs/placement.md.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// For an even number, the mean of the two middle values. @pre not empty
[[nodiscard]] double median_of(Numbers values);

/// Range of possible readings in each block of one field (step 3); shape (blocks).
struct BlockBounds {
  Numbers low_K, high_K;
};
[[nodiscard]] BlockBounds bounds_of(const PlacementProblem& problem, const Field& field);
/// Clamps each block to its bounds.
void keep_inside(const BlockBounds& bounds, Numbers& blocks_K);

/// Patterns to try: those of the structure file, else derived ones: all blocks; those near to and
/// far from the supports; the warmer and the cooler half; each alone; by +-10 and +-5 %.
[[nodiscard]] std::vector<Pattern> patterns_of(const PlacementProblem& problem, const Field& field);

struct ChangedBlocks {
  std::string name;  ///< "cooler half +10 %"; with a reduced r "bed +3.2 % (of 10 %)"
  Numbers blocks_K;  ///< theta3, shape (blocks)
};

/// theta3 = theta2 (1 + r / 100) for the pattern's blocks, theta2 for the others. At a bound, a
/// pattern of the file gets a smaller r for all its blocks; in a derived one each block is clamped.
/// @param percent  r of the pattern
/// @param blocks_K  theta2, shape (blocks)
/// @pre blocks_K is inside the bounds
[[nodiscard]] ChangedBlocks change_blocks(const Pattern& pattern, double percent,
                                          const BlockBounds& bounds, const Numbers& blocks_K);

/// Least squares fit of a X^2 + b X + c; of lower degree with fewer than three points.
/// @return {a, b, c}
[[nodiscard]] std::array<double, 3> fit_quadratic(std::span<const double> at,
                                                  std::span<const double> values);

/// Coefficients of all curves, highest order first; only c for a single output.
[[nodiscard]] Numbers curve_coefficients(const std::vector<Curve>& curves, const Numbers& rows_um);

/// Criterion for the tendency nearest in shape to the needed one. Curves along a guideway are
/// compared by quadratics a X^2 + b X + c; a single output is its c.
enum class Way {
  coefficients,  ///< scaled to equal size, compared by coefficient, largest first
  ratios,        ///< ratios of the coefficients to the largest one
  difference     ///< least squares between the curves scaled to equal size
};
[[nodiscard]] std::string_view name_of(Way way);
inline constexpr std::array<Way, 3> all_ways{Way::coefficients, Way::ratios, Way::difference};

enum class Start { mean, median, centroid };

struct TendencyOptions {
  Start start{Start::mean};
  double threshold_um{0.01};  ///< error at which the iteration stops
  int rounds_max{200};
};

struct TendencyRound {
  std::string pattern;  ///< "cooler half +10 %"
  int rank{0};          ///< 1: nearest in shape; more if nearer ones did not improve the error
  double rho{0.0};
  double error_um{0.0};  ///< RMS over the outputs after the round
};

struct TendencyRun {
  double error_um_at_start{0.0};
  std::vector<TendencyRound> rounds;
  std::string ended;  ///< reason of the end
  Numbers blocks_K;   ///< theta_g, shape (blocks)
};

/// Steps 2 to 10 for one temperature field.
[[nodiscard]] TendencyRun run_tendencies(const PlacementProblem& problem, const Field& field,
                                         Way way, const TendencyOptions& options);

struct TendencyPlacement {
  Way way{};
  std::vector<TendencyRun> runs;  ///< by used field
  std::vector<Index> sensors;     ///< one node per block
};

/// Step 11: the node of each block nearest to theta_g in least squares over the fields.
[[nodiscard]] TendencyPlacement place_by_tendencies(const PlacementProblem& problem, Way way,
                                                    const TendencyOptions& options);

}  // namespace thermocomp::placement
