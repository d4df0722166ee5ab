/// A stretch of rows.
#pragma once

#include <Eigen/Core>

namespace thermocomp::diagnosis {

/// Rows [begin, end) that are correlated with each other and with no other rows.
struct Block {
  Eigen::Index begin{0};
  Eigen::Index end{0};
};

}  // namespace thermocomp::diagnosis
