/// Sensor positions by tendency patterns: which uniform block temperatures would have given the
/// displacement of the full field, and where in each block they are found.
/// Source: JP6507619B2, the claim; steps are counted as in docs/placement.md.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// Of an even number the mean of the two in the middle. @pre not empty
[[nodiscard]] double median_of(Numbers values);

/// What a sensor in each block can read in one field (step 3); shape (blocks).
struct BlockBounds {
  Numbers low_K, high_K;
};
[[nodiscard]] BlockBounds bounds_of(const PlacementProblem& problem, const Field& field);
/// Each block by itself to the nearest bound.
void keep_inside(const BlockBounds& bounds, Numbers& blocks_K);

/// The patterns to try: those of the structure file or, where it has none, derived ones: all
/// blocks; those near to and far from what holds the machine; the warmer and the cooler half; each
/// alone; by 10 and by 5 per cent up and down.
[[nodiscard]] std::vector<Pattern> patterns_of(const PlacementProblem& problem, const Field& field);

struct ChangedBlocks {
  std::string name;  ///< "cooler half +10 %"; "bed +3.2 % (of 10 %)" where r was made smaller
  Numbers blocks_K;  ///< theta3, shape (blocks)
};

/// theta3 = theta2 (1 + r / 100) for the pattern's blocks, theta2 for the others. A pattern of the
/// file whose blocks would leave their bounds gets a smaller r, one for all its blocks; of a
/// derived one each block stays at its own bound.
/// @param percent  r as the pattern has it
/// @param blocks_K  theta2, shape (blocks)
/// @pre blocks_K is inside the bounds
[[nodiscard]] ChangedBlocks change_blocks(const Pattern& pattern, double percent,
                                          const BlockBounds& bounds, const Numbers& blocks_K);

/// Least squares of a X^2 + b X + c; of lower degree where there are fewer than three points.
/// @return {a, b, c}
[[nodiscard]] std::array<double, 3> fit_quadratic(std::span<const double> at,
                                                  std::span<const double> values);

/// The coefficients of all curves, of each the highest order first; of a single output c alone.
[[nodiscard]] Numbers curve_coefficients(const std::vector<Curve>& curves, const Numbers& rows_um);

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
