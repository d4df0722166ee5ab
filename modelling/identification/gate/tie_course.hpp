/// How far a measured course of temperatures moves tool and work, and the ties that make it least.
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
  Eigen::MatrixXd rises_K;  ///< shape (rows, 1 + ties): A - B, then each tie; of the first row 0
};

/// @param notes  for a person: what was left out of the runs
/// @throws ConfigurationError naming run and column
[[nodiscard]] std::vector<TieCourse> tie_courses(const GateFile& file,
                                                 const std::vector<RunFile>& runs,
                                                 std::vector<std::string>& notes);

/// Ki (A - B) - sum_j Kc_j C_j, shape (rows); positive when tool and work come closer.
/// @pre as many ties as the course has, or none
[[nodiscard]] Eigen::VectorXd displacement_um(const TieCourse& course, const TiedCoefficients& k);

/// Greatest minus least displacement, of the course in which that is most.
[[nodiscard]] double swing_um(const std::vector<TieCourse>& courses, const TiedCoefficients& k);

/// The ties within the file's bounds with the least swing: a differential evolution over heights
/// and logarithms of areas, with a fixed seed. A tie is taken to have the same temperatures
/// wherever it is; more than 2000 rows are thinned out for the search.
/// @throws ConfigurationError when every tie is fixed
[[nodiscard]] TiedColumns best_ties(const GateFile& file, const std::vector<TieCourse>& courses);

/// Displacement over time of each course without ties, as drawn and, if there is one, with the
/// best; then the swing over the height of each tie with the others at their best.
[[nodiscard]] std::string tie_picture(const GateFile& file, const std::vector<TieCourse>& courses,
                                      const TiedColumns* best);

}  // namespace thermocomp::identification
