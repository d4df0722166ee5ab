/// Search of all combinations of places by left-out error, from normal equations alone.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::identification {

/// A pivot below this share of its column's square sum counts as 0.
inline constexpr double singular_share = 1e-10;

/// X'X, X'Y and Y'Y: candidates first, then outputs; shape (candidates + outputs) squared.
struct NormalEquations {
  Eigen::Index candidates{0};
  Eigen::Index outputs{0};
  Eigen::MatrixXd total;               ///< over all rows
  std::vector<Eigen::MatrixXd> folds;  ///< left-out rows; the hot half last, if any
  /// Added to a fold's own diagonal, shape (candidates, folds): rows times the squared reading
  /// error, which adds rows * sum (coefficient * error)^2 to the left-out sum of squares.
  Eigen::MatrixXd reading_errors;
};
/// @param sensor_error_K  error of each place's reading, independent of the others
[[nodiscard]] NormalEquations normal_equations(const MeasuredTests& tests, double sensor_error_K);
/// As above, from columns computed for every run; the first `places` have reading errors.
[[nodiscard]] NormalEquations normal_equations(const MeasuredTests& tests,
                                               const std::vector<Eigen::MatrixXd>& columns,
                                               double sensor_error_K);

struct SubsetOptions {
  std::size_t terms_min{3};
  std::size_t terms_max{5};
  std::vector<std::size_t> group_of;  ///< candidate -> group; empty: free choice
  std::size_t of_a_group_max{2};
  std::size_t group_required{0};  ///< one of its places is required; only with group_of
  std::size_t kept{20};           ///< best subsets kept for each number of terms
};

struct Subset {
  std::vector<std::size_t> places;  ///< ascending
  /// Mean over outputs of left-out sum of squares / sum of squares without a model: 0 is perfect, 1
  /// equals no model.
  double score{0.0};
};

struct SubsetSearch {
  std::vector<std::vector<Subset>> best;  ///< [terms], best first
  std::uint64_t judged{0};
};

[[nodiscard]] double combinations(std::size_t candidates, std::size_t terms_min,
                                  std::size_t terms_max);

/// For every fold, exact least squares of each allowed combination on the other folds, and the sum
/// of squares on the fold left out.
///
/// Depth first over ascending places. Adding place k eliminates it from the training equations of
/// all folds (Gauss); the left-out fold undergoes the same congruence, c_i = A_ki / A_kk:
///   A_ij -= c_i A_kj, T_ij += c_i c_j T_kk - c_i T_kj - c_j T_ki.
/// A further place j then costs, per fold, b = A_jy / A_jj and T_yy - 2 b T_jy + b^2 T_jj. A place
/// that the others explain to one part in 10^10 is not added to them.
[[nodiscard]] SubsetSearch search_subsets(const NormalEquations& equations,
                                          const SubsetOptions& options);

}  // namespace thermocomp::identification
