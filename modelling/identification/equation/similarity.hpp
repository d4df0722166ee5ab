/// Similarity of places (JP7689460B2), and groups of places from it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp {
struct Drawing;
}

namespace thermocomp::identification {

/// Scope of max|dT_A|: all tests, or each test, which then has the same weight whatever the size of
/// its movements.
enum class LargestOver { all_tests, each_test };

/// S(A, B) = min over alpha >= 0 of sum (dT_A / max|dT_A| - alpha dT_B)^2, over all tests with one
/// alpha. `relative`: divided by sum (dT_A / max|dT_A|)^2: 0 for the same shape, 1 for no common
/// shape, independent of the number of samples. With one maximum over all tests it is 1 - cos^2 of
/// the angle between A and B (1 if the cosine is negative), and symmetric.
/// @return shape (places, places)
[[nodiscard]] Eigen::MatrixXd similarity(const MeasuredTests& tests, bool relative,
                                         LargestOver over = LargestOver::all_tests);

/// Relative similarity of each two places caused by noise alone: the part of a place's second
/// differences that the other places do not explain, in its own row and the reference row.
[[nodiscard]] Eigen::MatrixXd noise_floor(const MeasuredTests& tests);

/// Merge of two groups, in ascending order of S.
struct Merge {
  double threshold{0.0};  ///< S of the merging pair
  std::size_t groups{0};  ///< number after it
};

struct Grouping {
  double threshold{0.0};
  bool threshold_given{false};
  std::vector<std::vector<std::size_t>> groups;  ///< largest first, places in their order
  std::vector<Merge> merges;                     ///< independent of the threshold
};

/// Merges the groups of each pair with S up to the threshold, in ascending order of S.
[[nodiscard]] Grouping group_places(const Eigen::MatrixXd& s, double threshold);

/// Groups by the threshold in the widest gap (by ratio) between two successive merges, at most 0.3.
/// S below the noise floor counts as the floor.
[[nodiscard]] Grouping group_places(const Eigen::MatrixXd& s, const Eigen::MatrixXd& floor);

/// Heat map of `s` in the order of the groups, each framed.
/// @param names  of the places of `s`
[[nodiscard]] Drawing groups_drawing(const std::string& title,
                                     const std::vector<std::string>& names,
                                     const Eigen::MatrixXd& s, const Grouping& grouping);

}  // namespace thermocomp::identification
