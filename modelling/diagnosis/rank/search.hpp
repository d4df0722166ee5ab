/// Greedy search: fits and ranks all hypotheses, accepts the likeliest, and repeats.
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
  /// Residual variance of an output after over before all findings, without that of the noise.
  std::vector<double> unexplained_share;
  /// Relative errors of each output's coefficients, fitted jointly with all findings.
  std::vector<Eigen::VectorXd> coefficient_errors{};
  std::vector<double> noise_share;  ///< of an output's residual variance before any finding
  std::vector<bool> fitted;         ///< whether an output's coefficients were fitted to these rows
  /// The residual is large relative to noise and motion, and there is no finding.
  bool unexplained{false};
  std::map<std::string, double> families{};  ///< for the first finding, with `none`
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
