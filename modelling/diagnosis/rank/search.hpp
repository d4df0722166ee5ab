/// One finding after another: fit every hypothesis, rank them, accept the likeliest.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "modelling/diagnosis/rank/fits.hpp"
#include "modelling/diagnosis/rank/posterior.hpp"

namespace thermocomp::diagnosis {

/// What counts as a finding.
struct Rules {
  double probability_min{0.5};
  /// Least RMS of what a cause explains, as a share of the measured motion's; never below the noise
  /// of a single value.
  double motion_share_min{0.005};
  std::size_t findings_max{4};
};

struct SearchResult {
  std::vector<Finding> findings;  ///< in order of gain
  /// Share of an output's remaining variance, noise taken out, that is left.
  std::vector<double> unexplained_share;
  /// Of each output's coefficients, beside all findings: by what share they are wrong.
  std::vector<Eigen::VectorXd> coefficient_errors{};
  std::vector<double> noise_share;  ///< of an output's remaining variance before any finding
  /// Structure is left that is large against noise and motion, and nothing is named.
  bool unexplained{false};
  std::map<std::string, double> families{};  ///< for the first finding, and `none`
  std::vector<Explanation> weighed;          ///< for the first finding, likeliest first
};

/// @param accepted  called with what is accepted before the columns of any hypothesis are asked for
/// again
/// @param progress  called at each hypothesis
[[nodiscard]] SearchResult search(
    const MeasuredData& data, const StackedRows& rows, const std::vector<Hypothesis>& hypotheses,
    const Rules& rules,
    const std::function<void(const std::vector<Explanation>&)>& accepted = nullptr,
    const std::function<void()>& progress = nullptr);

}  // namespace thermocomp::diagnosis
