/// Columns, alone and side by side.
#pragma once

#include <Eigen/Core>

namespace thermocomp::diagnosis {

using Column = Eigen::VectorXd;

/// The values of a row lie next to each other: what goes from row to row does all columns at once.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace thermocomp::diagnosis
