/// Which places warm alike: JP7689460B2's similarity, and groups of places from it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp {
struct Drawing;
}

namespace thermocomp::identification {

/// Over what max|dT_A| is taken: all tests, or each test for itself, so that a test in which a
/// place moves little counts as much as one in which it moves far.
enum class LargestOver { all_tests, each_test };

/// S(A, B) = min over alpha >= 0 of sum (dT_A / max|dT_A| - alpha dT_B)^2, over all tests with one
/// alpha. `relative`: divided by sum (dT_A / max|dT_A|)^2, so that it is 0 for the same shape, 1
/// for none in common, whatever the number of samples. With one maximum over all tests that is
/// 1 - cos^2 of the angle between A and B (1 where the cosine is negative), and symmetric.
/// @return shape (places, places)
[[nodiscard]] Eigen::MatrixXd similarity(const MeasuredTests& tests, bool relative,
                                         LargestOver over = LargestOver::all_tests);

/// The relative similarity that noise alone would leave between each two places: noise is what
/// second differences of neighbouring rows show beyond those of the other places, and the reference
/// row has it too.
[[nodiscard]] Eigen::MatrixXd noise_floor(const MeasuredTests& tests);

/// One merging of two groups, in ascending order of S.
struct Merge {
  double threshold{0.0};  ///< S of the pair that merges them
  std::size_t groups{0};  ///< left after it
};

struct Grouping {
  double threshold{0.0};
  bool threshold_given{false};
  std::vector<std::vector<std::size_t>> groups;  ///< largest first, places in their order
  std::vector<Merge> merges;                     ///< what any other threshold would do
};

/// Pairs in ascending order of S up to the threshold, each merging the groups of its two places.
[[nodiscard]] Grouping group_places(const Eigen::MatrixXd& s, double threshold);

/// The threshold in the widest gap (by ratio) between one merging and the next, mergings below
/// the noise floor counting as at it, none above 0.3.
[[nodiscard]] Grouping group_places(const Eigen::MatrixXd& s, const Eigen::MatrixXd& floor);

/// The heat map of `s` in the order of the groups, each in a frame.
/// @param names  of the places of `s`
[[nodiscard]] Drawing groups_drawing(const std::string& title,
                                     const std::vector<std::string>& names,
                                     const Eigen::MatrixXd& s, const Grouping& grouping);

}  // namespace thermocomp::identification
