/// Displacement between tool and work from measured temperatures, and the ties that minimise it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"
#include "modelling/identification/gate/gate_file.hpp"

namespace thermocomp::identification {

struct TieCourse {
  std::string name;
  Eigen::VectorXd time_s;
  Eigen::MatrixXd rises_K;  ///< shape (rows, 1 + ties): A - B, then each tie; 0 in the first row
};

/// @param notes  receives what was left out of the runs
/// @throws ConfigurationError naming run and column
[[nodiscard]] std::vector<TieCourse> tie_courses(const GateFile& file,
                                                 const std::vector<RunFile>& runs,
                                                 std::vector<std::string>& notes);

/// Ki (A - B) - sum_j Kc_j C_j, shape (rows); positive if tool and work approach each other.
/// @pre `k` has as many ties as the course, or none
[[nodiscard]] Eigen::VectorXd displacement_um(const TieCourse& course, const TiedCoefficients& k);

/// Largest swing (greatest minus least displacement) of any course.
[[nodiscard]] double swing_um(const std::vector<TieCourse>& courses, const TiedCoefficients& k);

/// Ties within the file's bounds with the smallest swing, by differential evolution over heights
/// and logarithms of areas, with a fixed seed. A tie's temperatures are assumed independent of its
/// position; the search uses at most about 2000 rows.
/// @throws ConfigurationError if every tie is fixed
[[nodiscard]] TiedColumns best_ties(const GateFile& file, const std::vector<TieCourse>& courses);

/// Plot of each course's displacement without ties, as drawn and, if given, with the best ties;
/// then the swing over the height of each tie, the others at their best.
[[nodiscard]] std::string tie_picture(const GateFile& file, const std::vector<TieCourse>& courses,
                                      const TiedColumns* best);

}  // namespace thermocomp::identification
