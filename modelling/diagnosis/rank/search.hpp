/// One finding after another: fit every hypothesis, rank them, accept the likeliest.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "modelling/diagnosis/rank/fits.hpp"
#include "modelling/diagnosis/rank/posterior.hpp"

namespace thermocomp::diagnosis {

struct SearchResult {
  std::vector<Finding> findings;  ///< in order of gain
  /// Share of an output's remaining variance, noise taken out, that is left.
  std::vector<double> unexplained_share;
  /// Of each output's coefficients, beside all findings: by what share they are wrong.
  std::vector<Eigen::VectorXd> coefficient_errors{};
  std::vector<double> noise_share;  ///< of an output's remaining variance before any finding
  std::vector<bool> fitted;         ///< whether an output's coefficients were fitted to these rows
  /// Structure is left that is large against noise and motion, and nothing is named.
  bool unexplained{false};
  std::map<std::string, double> families{};  ///< for the first finding, and `none`
  std::vector<Explanation> weighed;          ///< for the first finding, likeliest first
};

/// @param progress  called at each hypothesis
/// @param motion_share_min  least RMS of the effect of a finding, as a share of the RMS of the
///         measured motion; the noise of a single value is a second lower bound
/// @param accepted  called with the findings before the columns of any hypothesis are requested
///         beside them
[[nodiscard]] SearchResult search(
    const MeasuredData& data, const std::vector<Hypothesis>& hypotheses,
    const std::function<void()>& progress = nullptr, double motion_share_min = 0.005,
    const std::function<void(const std::vector<Explanation>&)>& accepted = nullptr);

}  // namespace thermocomp::diagnosis
