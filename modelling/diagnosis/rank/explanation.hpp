/// A hypothesis with its shape and gains settled, and what speaks for it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

struct Explanation {
  const Hypothesis* hypothesis{nullptr};
  Shape shape{};
  std::vector<Eigen::VectorXd> gains{};  ///< one an output; empty: it does not act on it
  double score{0.0};  ///< ln L over that of nothing, its grid and gains paid for, with the witness
  double witness{0.0};  ///< the part of it that the reading itself adds, for a fault of a reading
  /// ln of the RMS before over after, of rows that it was not fitted to: the sum over the outputs,
  /// and the output that gains most.
  double left_out{0.0};
  double left_out_of_best{0.0};
  double probability{0.0};  ///< of the hypothesis alone
};

struct Finding {
  Explanation explanation;
  std::vector<Interval> shape_ci{};               ///< 95 %, one a shape parameter
  std::vector<std::vector<Interval>> gains_ci{};  ///< 95 %, of each output's gains
  double probability{0.0};                        ///< with all places that cannot be told apart
  double family_probability{0.0};
  std::vector<std::string> group{};         ///< these places, the subject's first
  std::vector<Explanation> alternatives{};  ///< likeliest first
};

}  // namespace thermocomp::diagnosis
